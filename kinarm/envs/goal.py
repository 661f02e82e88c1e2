"""The goal-conditioned environments: goals to be relabelled with hindsight."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from kinarm.envs.interface import GoalInterface, RewardType
from kinarm.envs.reach import ReachEnv
from kinarm.envs.vector import ReachVectorEnv
from kinarm.problem import ProblemLike
from kinarm.simulator import Simulator


class ReachGoalEnv(ReachEnv):
    """`ReachEnv` with goals as a dictionary, in the convention of Gymnasium-Robotics.

    Parameters
    ----------
    problem : ReachProblem, str or Path
        As for `ReachEnv`.
    reward_type : {"sparse", "dense"}
        -1 for every step that does not reach the goal and 0 for the one that does, or minus the
        distance [m].
    **settings
        As for `ReachEnv`; only ``collision`` of the problem's own reward has an effect.

    Notes
    -----
    **Observation**, ``Dict``: ``observation``, the part of the observation of `ReachEnv` that does
    not depend on the goal (orientations and positions of the joint frames, 42 numbers for the
    arms of six joints); ``achieved_goal``, the tool point x, y, z [m]; ``desired_goal``, the goal
    x, y, z [m].

    **Reward**: that of the reward type, and the problem's ``collision`` (-1 by default) if a
    move was refused. ``compute_reward(achieved_goal, desired_goal, info)`` returns it for one pair
    of goals or for many, as hindsight replay needs it. It depends on the goals and on
    ``info["collision"]`` only; ``compute_terminated`` and ``compute_truncated`` on the goals.

    **End**: terminated when the tool is within the tolerance of the goal; truncated at the
    horizon. A move that would touch something is refused, the arm stays where it is, and the
    episode goes on. An end by contact would not follow from the goals, and would reward giving up.
    ``kinarm-eval`` judges by the rules of `ReachEnv`, where contact ends an episode.

    **Info**: that of `ReachEnv`, without reward terms; ``collision`` and ``contact`` are about
    the last step.

    **Versions**: v0, the first.
    """

    def __init__(
        self,
        problem: ProblemLike = "right",
        *,
        reward_type: RewardType = "sparse",
        **settings: Any,
    ) -> None:
        self.reward_type = reward_type
        super().__init__(problem, **settings)

    def _make_interface(self, simulator: Simulator, dtype: DTypeLike) -> GoalInterface:
        self._goals = GoalInterface(simulator, dtype, self.reward_type)
        return self._goals

    def compute_reward(
        self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: object
    ) -> Any:
        """Reward of goals, shape (..., 3) [m]: a float for one pair of them, else an array."""
        return self._goals.compute_reward(achieved_goal, desired_goal, info)[()]

    def compute_terminated(
        self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: object
    ) -> Any:
        """Whether goals, shape (..., 3) [m], are reached."""
        return self._goals.compute_terminated(achieved_goal, desired_goal, info)[()]

    def compute_truncated(
        self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: object
    ) -> Any:
        """False: only the number of the step decides."""
        return self._goals.compute_truncated(achieved_goal, desired_goal, info)[()]


class ReachGoalVectorEnv(ReachVectorEnv):
    """A native batch of `ReachGoalEnv`.

    Parameters
    ----------
    num_envs, problem, **settings
        As for `ReachVectorEnv`.
    reward_type : {"sparse", "dense"}
        As for `ReachGoalEnv`.
    """

    def __init__(
        self,
        num_envs: int = 1,
        problem: ProblemLike = "right",
        *,
        reward_type: RewardType = "sparse",
        **settings: Any,
    ) -> None:
        self.reward_type = reward_type
        super().__init__(num_envs, problem, **settings)

    def _make_interface(self, simulator: Simulator, dtype: DTypeLike) -> GoalInterface:
        self._goals = GoalInterface(simulator, dtype, self.reward_type)
        return self._goals

    def compute_reward(
        self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: object
    ) -> NDArray[np.float64]:
        """Rewards of goals, shape (n, 3) each [m]."""
        return self._goals.compute_reward(achieved_goal, desired_goal, info)
