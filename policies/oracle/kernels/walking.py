"""Where goals are after each step."""

import numpy as np

from kinarm.kernels.arriving import put_goal
from kinarm.kernels.compiling import Array, kernel
from kinarm.kernels.goals import GoalRules
from kinarm.kernels.lanes import LANES, as_lanes, as_numbers


@kernel
def follow_goals(goal: GoalRules, goals: Array, number: int, walks: Array) -> None:
    """Fill in where goals are, shape (n, horizon + 1, goal_width).

    Parameters
    ----------
    goal, goals, number
        How goals change, those of all episodes, shape (n, n_goals, goal_width), and
        which of them is followed.
    walks : ndarray
        What is filled in.
    """
    n, n_steps, width = walks.shape
    present = as_lanes(np.zeros((1, width, LANES)))
    for e in range(n):
        for step in range(n_steps):
            put_goal(e, step, number, 0, goal, goals, present)
            for i in range(width):
                walks[e, step, i] = as_numbers(present)[0, i, 0]
