"""Observing a configuration: tool point, observation, distance to the goal."""

import math

from kinarm.kernels.compiling import Array, inlined
from kinarm.kernels.kinematics import to_world
from kinarm.observation import write_observation


@inlined
def observe(tool: Array, poses: Array, goals: Array, row: int, observations: Array) -> float:
    """Fill in a row of the observations and return the distance from the tool to the goal [m]."""
    point = to_world(poses, poses.shape[0] - 1, tool[0], tool[1], tool[2])
    write_observation(poses, point, goals, row, observations, 0)
    dx, dy, dz = goals[row, 0] - point[0], goals[row, 1] - point[1], goals[row, 2] - point[2]
    return math.sqrt(dx * dx + dy * dy + dz * dz)
