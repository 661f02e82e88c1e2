"""Observing a configuration: tool point, observation, distance to the goal."""

import math

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.compiling import inlined
from kinarm.kernels.kinematics import to_world
from kinarm.observation import write_observation


@inlined
def observe(
    tool: NDArray[np.float64],
    poses: NDArray[np.float64],
    goals: NDArray[np.float64],
    row: int,
    observations: NDArray[np.float64],
) -> float:
    """Fill in a row of the observations and return the distance from the tool to the goal [m].

    Parameters
    ----------
    tool : ndarray, shape (3,)
        Tool point in the last joint frame [m].
    poses : ndarray, shape (n_joints + 1, POSE)
        Forward kinematics.
    goals, observations : ndarray, shape (n_episodes, 3) and (n_episodes, n_observations)
        Goal points [m], and what is filled in.
    row : int
        Episode.
    """
    point = to_world(poses, poses.shape[0] - 1, tool[0], tool[1], tool[2])
    write_observation(poses, point, goals, row, observations, 0)
    dx, dy, dz = goals[row, 0] - point[0], goals[row, 1] - point[1], goals[row, 2] - point[2]
    return math.sqrt(dx * dx + dy * dy + dz * dz)
