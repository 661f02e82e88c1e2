"""Observation, distance and reward of a step.

The reward is a sum of terms (paper, section 3.3: closer is positive, farther negative). A new
term is a field of `kinarm.task.RewardWeights` and a formula here, in the same order.
"""

import math

from kinarm.kernels.compiling import Array, Vector, inlined
from kinarm.kernels.kinematics import to_world
from kinarm.kernels.lanes import select
from kinarm.observation import write_observation

PROGRESS, CLOSER, STEP, COLLISION, SUCCESS = range(5)
"""Columns of the terms; `COLLISION` and later ones are paid at the end."""


@inlined
def add_reward(
    weights: Array,
    before: float,
    after: float,
    collided: bool,
    reached: bool,
    terms: Array,
    total: Array,
    e: int,
) -> None:
    """Fill in the weighted terms of an episode's step, and add them to its return.

    Takes the tool's distances from the goal before and after the step [m].
    """
    sign = select(after < before, 1.0, select(after > before, -1.0, 0.0))
    terms[e, PROGRESS] = weights[PROGRESS] * (before - after)
    terms[e, CLOSER] = weights[CLOSER] * sign
    terms[e, STEP] = weights[STEP]
    terms[e, COLLISION] = select(collided, weights[COLLISION], 0.0)
    terms[e, SUCCESS] = select(reached, weights[SUCCESS], 0.0)
    of_every_step = terms[e, PROGRESS]
    for term in range(PROGRESS + 1, COLLISION):
        of_every_step += terms[e, term]
    total[e] += of_every_step
    for term in range(COLLISION, weights.shape[0]):
        total[e] += terms[e, term]


@inlined
def observe(tool: Array, poses: Array, goals: Array, row: int, observations: Array) -> float:
    """Write a row of observations; return the distance to the goal [m].

    Takes the poses of the joint frames alone.
    """
    point = to_world(poses, poses.shape[0] - 1, tool[0], tool[1], tool[2])
    write_observation(poses, point, goals, row, observations, 0)
    return distance_between(point, goals, row)


@inlined
def distance_to(tool: Array, poses: Array, goals: Array, row: int) -> float:
    """Distance of the tool from a goal [m]."""
    point = to_world(poses, poses.shape[0] - 1, tool[0], tool[1], tool[2])
    return distance_between(point, goals, row)


@inlined
def distance_between(point: Vector, goals: Array, row: int) -> float:
    """Distance of a point from a goal [m]."""
    dx, dy, dz = goals[row, 0] - point[0], goals[row, 1] - point[1], goals[row, 2] - point[2]
    return math.sqrt(dx * dx + dy * dy + dz * dz)
