"""Goals of episodes one after the other, and where they move."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.compiling import Array
from kinarm.policies.oracle.kernels.walking import follow_goals
from kinarm.simulator import Simulator


class Stage(NamedTuple):
    """A goal of each of n episodes.

    Attributes
    ----------
    goals : ndarray, shape (n, goal_width)
        The goals, before they move.
    walks : ndarray, shape (n, horizon + 1, goal_width), optional
        Where they are after each step of the episode, if they move.
    """

    goals: Array
    walks: Array | None = None

    @property
    def targets(self) -> Array:
        """What bounds are about: goals, or their walks."""
        return self.goals if self.walks is None else self.walks

    def of(self, rows: NDArray[np.int64], taken: NDArray[np.int64]) -> "Stage":
        """Goals of some episodes, from the steps on that they have taken."""
        if self.walks is None:
            return Stage(self.goals[rows])
        last = self.walks.shape[1] - 1
        steps = np.fmin(taken[:, None] + np.arange(last + 1), last)
        return Stage(self.goals[rows], self.walks[rows[:, None], steps])


def stages_of(simulator: Simulator, starts: Array, goals: Array) -> list[Stage]:
    """Goals of episodes in turn.

    Parameters
    ----------
    simulator, starts, goals
        The simulator, starts, shape (n, n_joints) [rad or m], and first goals,
        shape (n, goal_width).
    """
    goal, rules = simulator.task.goal, simulator.world.rules.goal
    if not goal.changes:
        return [Stage(goals)]
    drawn, stages = simulator.reset(starts, goals).pursuit.goals, []
    for number in range(goal.sequence):
        walks = None
        if goal.motion is not None:
            walks = np.empty((len(goals), simulator.task.horizon + 1, goals.shape[1]))
            follow_goals(rules, drawn, number, walks)
        stages.append(Stage(drawn[:, number].copy(), walks))
    return stages
