"""Environments and hyperparameters for Stable-Baselines3 and rl-zoo3."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import gymnasium
from gymnasium.envs.registration import load_env_creator
from numpy.typing import DTypeLike

from kinarm._files import shipped_files
from kinarm.envs import ENVIRONMENTS
from kinarm.errors import UnknownNameError, whole_number
from kinarm.policies.learners import find_learner
from kinarm.problem import ProblemLike

if TYPE_CHECKING:
    from kinarm.envs import ReachEnv
    from kinarm.policies.sb3.vec_env import SB3VecEnv


def sb3_vec_env(
    problem: ProblemLike = "right",
    n_envs: int = 1,
    *,
    seed: int | None = None,
    observation_dtype: DTypeLike = "float32",
    reward_type: str | None = None,
    threads: int | None = None,
    replay_share: float = 0.0,
    replay_size: int = 8192,
    render_mode: str | None = None,
    width: int = 480,
    height: int = 360,
    camera: Any = None,
    **overrides: Any,
) -> "SB3VecEnv":
    """Make a batch of arms as the ``env`` of a learner of Stable-Baselines3.

    Arm i has the episodes of the single environment with the seed + i.

    Parameters
    ----------
    problem : ReachProblem, str or Path
        As for `kinarm.ReachEnv`; or the id of an environment, such as
        ``"kinarm/ReachRight-v0"`` or, goal-conditioned,
        ``"kinarm/ReachGoalRight-v0"``.
    n_envs, seed : int
        Number of arms, and seed, which a learner's own ``seed`` replaces.
    observation_dtype, reward_type : str, optional
        As for `kinarm.ReachGoalEnv`; a reward type makes any problem
        goal-conditioned.
    threads : int, optional
        As for `kinarm.Simulator`.
    replay_share, replay_size : float and int
        Probability that an episode begins where one of the last ``replay_size``
        failures did, told by infos (``replayed``). Evaluate policies without
        it.
    render_mode, width, height, camera
        As for `kinarm.ReachEnv`.
    **overrides
        As for `kinarm.ReachProblem.replace`: ``horizon``, ``reward`` ...

    Raises
    ------
    MissingExtraError
        If Stable-Baselines3 is not installed.
    """
    find_learner("sb3-ppo").check_installed()
    from kinarm.policies.sb3.vec_env import SB3VecEnv

    whole_number("n_envs", n_envs, 1)
    settings = {"observation_dtype": observation_dtype, **overrides}
    if reward_type is not None:
        settings["reward_type"] = reward_type
    single = _single_environment(problem, settings)
    replay: Any = {"replay_share": replay_share, "replay_size": replay_size}
    shown: Any = {"render_mode": render_mode, "width": width, "height": height}
    env = SB3VecEnv(single, n_envs, threads=threads, camera=camera, **replay, **shown)
    env.seed(None if seed is None else whole_number("seed", seed, 0))
    return env


def _single_environment(problem: ProblemLike, settings: dict[str, Any]) -> "ReachEnv":
    """The single environment of the batch."""
    from kinarm.envs import ReachEnv, ReachGoalEnv

    name = str(problem).rpartition(":")[2]
    if name in gymnasium.registry:
        entry_point = gymnasium.spec(name).entry_point
        maker = load_env_creator(entry_point) if isinstance(entry_point, str) else entry_point
        if isinstance(maker, type) and issubclass(maker, ReachEnv):
            return cast("ReachEnv", gymnasium.make(name, **settings).unwrapped)
    elif not name.startswith("kinarm/") or name.endswith(".toml"):
        return (ReachGoalEnv if "reward_type" in settings else ReachEnv)(problem, **settings)
    raise UnknownNameError("environment", str(problem), ENVIRONMENTS)


def zoo_hyperparameters(algorithm: str) -> Path:
    """File that rl-zoo3 takes as ``--conf-file``, with kinarm's environments.

    Parameters
    ----------
    algorithm : str
        As rl-zoo3 names it: ``"ppo"``, ``"a2c"``, ``"sac"``, ``"td3"`` or
        ``"tqc"``.

    Raises
    ------
    UnknownNameError
        If no such file ships.
    """
    files = shipped_files("zoo", ".yml")
    if algorithm not in files:
        raise UnknownNameError("algorithm", algorithm, files)
    return files[algorithm]
