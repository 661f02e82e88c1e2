"""Environments for Stable-Baselines3."""

from typing import TYPE_CHECKING, Any, cast

import gymnasium
from gymnasium.envs.registration import load_env_creator
from numpy.typing import DTypeLike

from kinarm.envs import ENVIRONMENTS
from kinarm.errors import UnknownNameError, whole_number
from kinarm.policies.learners import find_learner
from kinarm.problem import ProblemLike

if TYPE_CHECKING:
    from kinarm.envs import ReachVectorEnv
    from kinarm.policies.sb3.vec_env import SB3VecEnv


def sb3_vec_env(
    problem: ProblemLike = "right",
    n_envs: int = 1,
    *,
    seed: int | None = None,
    observation_dtype: DTypeLike = "float32",
    goal_conditioned: bool = False,
    **settings: Any,
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
    observation_dtype : dtype
        As for `kinarm.ReachEnv`.
    goal_conditioned : bool
        Whether arms are those of `kinarm.ReachGoalEnv`, in any problem.
    **settings
        As for `kinarm.ReachVectorEnv`: ``threads``, ``render_mode``, ``width``, ``height``,
        ``camera``, and settings of the problem such as ``horizon`` and ``reward``.

    Raises
    ------
    MissingExtraError
        If Stable-Baselines3 is not installed.
    """
    find_learner("sb3-ppo").check_installed()
    from kinarm.policies.sb3.vec_env import SB3VecEnv

    whole_number("n_envs", n_envs, 1)
    settings["observation_dtype"] = observation_dtype
    env = SB3VecEnv(_batch(problem, n_envs, goal_conditioned, settings))
    env.seed(None if seed is None else whole_number("seed", seed, 0))
    return env


def _batch(
    problem: ProblemLike, n_envs: int, goal_conditioned: bool, settings: dict[str, Any]
) -> "ReachVectorEnv":
    """The batch of a problem or of an environment's id."""
    from kinarm.envs import ReachGoalVectorEnv, ReachVectorEnv

    kind = ReachGoalVectorEnv if goal_conditioned else ReachVectorEnv
    name = str(problem).rpartition(":")[2]
    if name in gymnasium.registry:
        entry_point = gymnasium.spec(name).vector_entry_point
        maker = load_env_creator(entry_point) if isinstance(entry_point, str) else entry_point
        if isinstance(maker, type) and issubclass(maker, kind):
            made = gymnasium.make_vec(name, n_envs, "vector_entry_point", **settings)
            return cast("ReachVectorEnv", made.unwrapped)
    elif not name.startswith("kinarm/") or name.endswith(".toml"):
        return kind(n_envs, problem, **settings)
    raise UnknownNameError("environment", str(problem), ENVIRONMENTS)
