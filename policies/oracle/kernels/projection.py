"""Inverse kinematics: configurations moved until they bring the tool to a goal, within limits."""

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.kernels.compiling import Array, Vector, inlined, lean_kernel
from kinarm.kernels.inverse import take_out_blocked, take_step
from kinarm.kernels.kinematics import POSE, place, point_jacobian, to_world
from kinarm.kernels.lanes import LANES, as_numbers, lane_bits, lanes, select
from kinarm.kernels.records import Fixed, Layout

ITERATIONS = 24
"""Newton steps before a configuration is given up."""

DAMPING = 1e-4
"""Added to the diagonal of J J^T, which limits steps near singular configurations [m^2]."""


class Moving(NamedTuple):
    """Configurations side by side in lanes.

    Attributes
    ----------
    q : (1, n_joints)
        Configuration [rad or m].
    lower, upper : (n,)
        Limits of the first n joints [rad or m].
    goal : (3,)
        Goal position [m].
    radius, distance : (1,)
        Distance from the goal at which it is left, and where it is [m].
    iteration : (1,)
        Steps so far.
    poses : (n_joints + 1, POSE)
        Forward kinematics.
    jacobian : (3, n)
        How fast the tool moves per unit speed of each joint [m/rad, or m/m].
    step : (n,)
        Where the joints go next [rad or m].
    rows : (LANES,) of whole numbers, not of lanes
        Which configurations are in the lanes.
    """

    q: Array
    lower: Array
    upper: Array
    goal: Array
    radius: Array
    distance: Array
    iteration: Array
    poses: Array
    jacobian: Array
    step: Array
    rows: NDArray[np.int64]


@cache
def layout(n_joints: int, n: int) -> Layout:
    """How `Moving` lies in memory."""
    shapes = {
        "q": (Fixed(1), n_joints),
        "lower": (n,),
        "upper": (n,),
        "goal": (Fixed(3),),
        **dict.fromkeys(("radius", "distance", "iteration"), (Fixed(1),)),
        "poses": (n_joints + 1, Fixed(POSE)),
        "jacobian": (Fixed(3), n),
        "step": (n,),
    }
    arrays = {name: (lanes, shape) for name, shape in shapes.items()}
    return Layout("Moving", {**arrays, "rows": (types.int64, (Fixed(LANES),))})


@inlined
def damped_step(jacobian: Array, vector: Vector, step: Array) -> None:
    """Fill in J^T (J J^T + damping)^-1 v, by the adjugate of the 3 x 3 matrix."""
    a00, a11, a22 = DAMPING, DAMPING, DAMPING
    a01, a02, a12 = 0.0, 0.0, 0.0
    for k in range(step.shape[0]):
        jx, jy, jz = jacobian[0, k], jacobian[1, k], jacobian[2, k]
        a00 += jx * jx
        a11 += jy * jy
        a22 += jz * jz
        a01 += jx * jy
        a02 += jx * jz
        a12 += jy * jz
    b00, b01, b02 = a11 * a22 - a12 * a12, a02 * a12 - a01 * a22, a01 * a12 - a02 * a11
    b11, b12, b22 = a00 * a22 - a02 * a02, a01 * a02 - a00 * a12, a00 * a11 - a01 * a01
    determinant = a00 * b00 + a01 * b01 + a02 * b02
    vx, vy, vz = vector
    x = (b00 * vx + b01 * vy + b02 * vz) / determinant
    y = (b01 * vx + b11 * vy + b12 * vz) / determinant
    z = (b02 * vx + b12 * vy + b22 * vz) / determinant
    for k in range(step.shape[0]):
        step[k] = jacobian[0, k] * x + jacobian[1, k] * y + jacobian[2, k] * z


@inlined
def move(moving: Moving, vector: Vector, jacobian: Array, step: Array) -> None:
    """Move configurations by a damped step along a vector [m], within their limits."""
    q, lower, upper = moving.q, moving.lower, moving.upper
    blocked = True
    while blocked:
        damped_step(jacobian, vector, step)
        blocked = take_out_blocked(q, lower, upper, step, jacobian)
    take_step(q, lower, upper, step)


@lean_kernel
def damped_least_squares(
    first: int,
    last: int,
    moving: Moving,
    chain: Chain,
    owner: NDArray[np.int64],
    lower: Array,
    upper: Array,
    goals: Array,
    radius: Array,
    configurations: Array,
    distances: Array,
) -> None:
    """Move configurations until the tool is within a radius of the goal, by damped Newton steps.

    A row that has ended makes room in its lane for the next one.

    Parameters
    ----------
    first, last : int
        Range of the rows.
    moving, chain : Moving and Chain
        Work space, and the arm.
    owner : ndarray of int, shape (n_rows,)
        Which row of goals and limits belongs to a configuration.
    lower, upper, goals : ndarray, shape (n_goals, n) twice and (n_goals, 3)
        Limits of the first n joints, the others stay [rad or m]; goals [m].
    radius : ndarray, shape (n_rows,)
        Distance from the goal at which a configuration is left [m].
    configurations : ndarray, shape (n_rows, n_joints)
        Joint positions; changed [rad or m].
    distances : ndarray, shape (n_rows,)
        Where the distances from the tool to the goal go [m].
    """
    tool, rows = chain.tool, moving.rows
    n_joints, n = configurations.shape[1], lower.shape[1]
    poses, jacobian, step = moving.poses, moving.jacobian, moving.step
    # The numbers in the lanes.
    q, lowest, highest = as_numbers(moving.q), as_numbers(moving.lower), as_numbers(moving.upper)
    aims, radii = as_numbers(moving.goal), as_numbers(moving.radius)
    found, iterations = as_numbers(moving.distance), as_numbers(moving.iteration)
    waiting, n_moving, free = first, 0, (1 << LANES) - 1
    while True:
        # Put the next rows into lanes that are free.
        for lane in range(LANES if waiting < last else 0):
            if free >> lane & 1 and waiting < last:
                goal, rows[lane] = owner[waiting], waiting
                for k in range(n_joints):
                    q[0, k, lane] = configurations[waiting, k]
                for k in range(n):
                    lowest[k, lane] = lower[goal, k]
                    highest[k, lane] = upper[goal, k]
                for k in range(3):
                    aims[k, lane] = goals[goal, k]
                radii[0, lane] = radius[waiting]
                iterations[0, lane] = 0.0
                waiting += 1
                n_moving += 1
                free &= ~(1 << lane)
        if n_moving == 0:
            return
        # Measure the distance to the goal, and take out what has come close enough.
        place(chain, moving.q, poses)
        point = to_world(poses, n_joints, tool[0], tool[1], tool[2])
        x, y, z = moving.goal[0] - point[0], moving.goal[1] - point[1], moving.goal[2] - point[2]
        distance = math.sqrt(x * x + y * y + z * z)
        moving.distance[0] = distance
        ended = (distance <= moving.radius[0]) | (moving.iteration[0] >= ITERATIONS)
        ended_bits = lane_bits(ended) & ~free
        for lane in range(LANES if ended_bits != 0 else 0):
            if ended_bits >> lane & 1:
                for k in range(n):
                    configurations[rows[lane], k] = q[0, k, lane]
                distances[rows[lane]] = found[0, lane]
                n_moving -= 1
        free |= ended_bits
        # Aimed at half the radius, a step that falls short still arrives. What has ended stays.
        share = select(ended, 0.0, 1.0 - 0.5 * moving.radius[0] / distance)
        point_jacobian(chain.prismatic, chain.axis, poses, point, jacobian)
        move(moving, (share * x, share * y, share * z), jacobian, step)
        moving.iteration[0] += 1.0
