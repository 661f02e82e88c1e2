"""Making the environment for Stable-Baselines3 from a problem, or from an id of Gymnasium."""

from typing import TYPE_CHECKING, Any, cast

import gymnasium
from gymnasium.envs.registration import load_env_creator
from numpy.typing import DTypeLike

from kinarm._validation import whole_number
from kinarm.envs import ENVIRONMENTS
from kinarm.errors import UnknownNameError
from kinarm.failed_scenarios import Replay
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
    """Make a batch of arms that every learner of Stable-Baselines3 takes as its ``env``.

    Arm i goes through the same episodes as the single environment with the seed + i, and all of
    them are stepped at once.

    Parameters
    ----------
    problem : ReachProblem, str or Path
        As for `kinarm.ReachEnv`; or the id of an environment, such as
        ``"kinarm/ReachRight-v0"`` or, goal-conditioned, ``"kinarm/ReachGoalRight-v0"``.
    n_envs : int
        Number of arms.
    seed : int, optional
        Of the episodes; a learner's own ``seed`` replaces it.
    observation_dtype : {"float32", "float64"}
        Type of observations; the networks of Stable-Baselines3 compute in float32.
    reward_type : {"sparse", "dense"}, optional
        Makes any problem goal-conditioned; see `kinarm.ReachGoalEnv`.
    threads : int, optional
        As for `kinarm.Simulator`.
    replay_share : float
        Probability that an episode begins where an earlier one ended without success, with the
        same goal; infos tell which did (``replayed``). A policy then learns on harder scenarios
        than it is judged by: evaluate it in an environment without.
    replay_size : int
        How many of the last failures are kept.
    render_mode, width, height, camera
        As for `kinarm.ReachEnv`.
    **overrides
        What `kinarm.ReachProblem.replace` takes, such as ``horizon`` or
        ``reward={"success": 1.0}``.

    Raises
    ------
    MissingExtraError
        If Stable-Baselines3 is not installed.
    UnknownNameError
        If there is no such environment or problem.
    InvalidInputError
        If there are no arms, or an argument cannot have its value.
    """
    find_learner("ppo").check_installed()
    from kinarm.policies.sb3.vec_env import SB3VecEnv
    from kinarm.simulator import Simulator

    whole_number("n_envs", n_envs, 1)
    if seed is not None:
        whole_number("seed", seed, 0)
    replay = Replay(share=replay_share, size=replay_size)
    goals = {} if reward_type is None else {"reward_type": reward_type}
    settings = {"observation_dtype": observation_dtype, **goals, **overrides}
    single = _single_environment(problem, settings)
    simulator = Simulator(single.simulator.problem, threads=threads)
    picture = {"width": width, "height": height, "camera": camera}
    env = SB3VecEnv(
        simulator,
        n_envs,
        single.interface,
        spec=single.spec,
        replay=replay if replay_share else None,
        render_mode=render_mode,
        **picture,
    )
    if seed is not None:
        env.seed(seed)
    return env


def _single_environment(problem: ProblemLike, settings: dict[str, Any]) -> "ReachEnv":
    """The single environment that the batch multiplies."""
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
