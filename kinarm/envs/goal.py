"""The goal-conditioned environments, for hindsight replay."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium.spaces import Dict, Space
from numpy.typing import ArrayLike, DTypeLike, NDArray

from kinarm.envs.environment import (
    ArmEnvironment,
    Array,
    Interface,
    Observations,
    Outcome,
    bounded_space,
    state_bounds,
)
from kinarm.envs.reach import ReachEnv
from kinarm.envs.vector import ReachVectorEnv
from kinarm.episodes import TRUNCATED, Episodes
from kinarm.errors import InvalidInputError
from kinarm.goals import REST_PARTS
from kinarm.simulator import Simulator, StepResult


class GoalRewards:
    """Rewards and ends that follow from goals."""

    simulator: Simulator

    def compute_reward(
        self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: object
    ) -> Any:
        """Reward of achieved goals for desired ones.

        Parameters
        ----------
        achieved_goal, desired_goal : array_like, shape (..., goal_width)
            What the tool has reached, its point first, and goal [m].
        info : mapping or sequence of mapping
            That of the step, or one for each, with ``collision``.

        Returns
        -------
        float or ndarray, shape (...)
        """
        reached = self.compute_terminated(achieved_goal, desired_goal, info)
        penalty = self.simulator.task.reward.collision
        return (np.where(reached, 0.0, -1.0) + penalty * _collided(info))[()]

    def compute_terminated(
        self,
        achieved_goal: ArrayLike,
        desired_goal: ArrayLike,
        info: object,  # noqa: ARG002
    ) -> Any:
        """Whether goals are reached.

        Parameters
        ----------
        achieved_goal, desired_goal, info
            As for `compute_reward`; infos have no effect.
        """
        return self.simulator.world.at_goals(achieved_goal, desired_goal)

    def compute_truncated(
        self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: object
    ) -> Any:
        """False: the step's number alone decides.

        Parameters
        ----------
        achieved_goal, desired_goal, info
            As for `compute_reward`, without effect.
        """
        return self.compute_terminated(achieved_goal, desired_goal, info) & False


class GoalInterface(GoalRewards, Interface):
    """Goals as a dictionary, and rewards for any goals.

    A move that would touch something is refused and costs the problem's reward for a collision.
    The episode goes on, so giving up never pays. Arguments are as for `ReachGoalEnv`.
    """

    tells_terms = False

    def __init__(self, simulator: Simulator, dtype: DTypeLike = np.float64) -> None:
        layout, goal = simulator.world.layout, simulator.task.goal
        (self._goal, self._offset), self._own = layout.goal_entries, layout.entries(of_goal=False)
        if goal.hold > 1 or goal.speed is not None or goal.changes:
            raise InvalidInputError(
                "goals as a dictionary stand and are reached once touched: hold, speed, sequence "
                "and motion do not apply"
            )
        if len(self._goal) != simulator.world.goal_width:
            parts = " and ".join(REST_PARTS[goal.kind])
            raise InvalidInputError(f"goals as a dictionary need the observation's parts {parts}")
        super().__init__(simulator, dtype)

    def _space(self) -> Space[Any]:
        lower, upper = state_bounds(self.simulator)
        reach = np.full(3, self.simulator.arm.reach)
        rest = self._goal[3:]
        bounds = {
            "observation": (lower[self._own], upper[self._own]),
            "achieved_goal": (np.r_[-reach, lower[rest]], np.r_[reach, upper[rest]]),
            "desired_goal": (lower[self._goal], upper[self._goal]),
        }
        return Dict({name: bounded_space(pair, self._dtype) for name, pair in bounds.items()})

    def observe(self, observations: Array) -> Observations:
        """Split observations into ``observation``, ``achieved_goal`` and ``desired_goal``."""
        achieved, desired = self._goals(observations)
        own = observations[:, self._own].astype(self._dtype, copy=False)
        return {"observation": own, "achieved_goal": achieved, "desired_goal": desired}

    def _goals(self, observations: Array) -> tuple[NDArray[Any], NDArray[Any]]:
        """What is reached, and goals, shape (n, goal_width) each."""
        goals = observations[:, self._goal]
        tools = goals - observations[:, self._offset]
        return tools.astype(self._dtype, copy=False), goals.astype(self._dtype)

    def step_outcome(self, episodes: Episodes, result: StepResult) -> Outcome:
        """Reward by the goals; episodes go on after a refused move."""
        truncated = result.truncated
        if np.count_nonzero(result.collision):
            self.simulator.go_on(episodes, result.collision.nonzero()[0])
            truncated = truncated | (episodes.status == TRUNCATED) & result.collision
        info = {"collision": result.collision}
        reward = self.compute_reward(*self._goals(episodes.observation), info)
        return reward, result.success, truncated


class GoalEnvironment(GoalRewards, ArmEnvironment):
    """An environment with a `GoalInterface`."""

    interface_kind = GoalInterface


class ReachGoalEnv(GoalEnvironment, ReachEnv):
    """`ReachEnv` with goals as a dictionary, in the convention of Gymnasium-Robotics.

    Parameters
    ----------
    problem : ReachProblem, str or Path
        As for `ReachEnv`.
    **settings
        As for `ReachEnv`; only ``collision`` of the problem's own reward has an
        effect.

    Notes
    -----
    **Observation**, ``Dict``: ``observation``, the part of the observation of `ReachEnv` that does
    not depend on the goal (orientations and positions of the joint frames, 42 numbers for the
    arms of six joints); ``achieved_goal``, the tool point x, y, z [m]; ``desired_goal``, the goal
    x, y, z [m]. Goals with a direction, a rotation or joints have these behind.

    **Reward**: -1 for each step but 0 for one that reaches the goal, and the
    problem's ``collision`` (-1 by default) if a move was refused.
    ``compute_reward(achieved_goal, desired_goal, info)`` returns it for one or
    many pairs of goals, from these and ``info["collision"]`` only;
    ``compute_terminated`` and ``compute_truncated`` depend on the goals.

    **End**: terminated when the tool is within the tolerance of the goal;
    truncated at the horizon. A move that would touch something is refused, the
    arm stays, and the episode goes on: an end by contact would not follow from
    the goals, and would reward giving up. ``kinarm-eval`` goes by the rules of
    `ReachEnv`, where contact ends an episode.

    **Info**: that of `ReachEnv`, without reward terms; ``collision`` and
    ``contact`` are about the last step.

    **Versions**: v0, the first.
    """


class ReachGoalVectorEnv(GoalEnvironment, ReachVectorEnv):
    """A native batch of `ReachGoalEnv`.

    Parameters
    ----------
    num_envs, problem, **settings
        As for `ReachVectorEnv`.
    """


def _collided(info: Any) -> NDArray[np.bool_]:
    """Whether infos, of a step, a batch or a sequence, tell of collisions."""
    if isinstance(info, Mapping):
        return np.asarray(info.get("collision", False))
    return np.array([each.get("collision", False) for each in info], dtype=bool)
