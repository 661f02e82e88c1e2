"""Inverse kinematics: configurations moved to goals, within limits."""

import math
from functools import cache
from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.kernels.compiling import Array, Vector, inlined, lean_kernel
from kinarm.kernels.inverse import damped_step as damped_step_of_rows
from kinarm.kernels.inverse import orientation_error, take_out_blocked, take_step
from kinarm.kernels.kinematics import POSE, forward_kinematics, point_jacobian, to_world
from kinarm.kernels.lane_copies import put, take
from kinarm.kernels.lanes import LANES, as_numbers, lane_bits, lanes, select
from kinarm.kernels.records import Fixed, Layout
from kinarm.kernels.work_space import ONE, THREE
from kinarm.policies.oracle.kernels.rotation import Turn

ITERATIONS = 24
"""Newton steps before a configuration is given up."""

DAMPING = 1e-4
"""Added to the diagonal of J J^T, to limit steps near singularities [m^2]."""


@cache
def layout(n_joints: int, n: int, n_axes: int) -> Layout:
    """Configurations in lanes, of which the first n joints move, for axes of the tool or none."""
    rows = Fixed(6 if n_axes > 0 else 3)
    shapes = {
        # Configurations, and their limits [rad or m].
        "q": (ONE, n_joints),
        **dict.fromkeys(("lower", "upper"), (ONE, n)),
        # Goal, distance at which to stop, and distance now [m]; steps so far.
        "goal": (ONE, THREE),
        **dict.fromkeys(("radius", "distance", "iteration"), (ONE,)),
        # Directions of axes.
        "wanted": (n_axes, THREE),
        # Poses, Jacobian of the tool [m/rad, or m/m], next step [rad or m], and space for it.
        "poses": (n_joints + 1, Fixed(POSE)),
        "jacobian": (rows, n),
        "step": (n,),
        "error": (rows,),
        "square": (Fixed(rows + 1), rows),
    }
    arrays = {name: (lanes, shape) for name, shape in shapes.items()}
    # Rows of the configurations in the lanes.
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


@lean_kernel
def damped_least_squares(
    first: int,
    last: int,
    moving: Any,
    chain: Chain,
    owner: NDArray[np.int64],
    lower: Array,
    upper: Array,
    goals: Array,
    turn: Turn,
    wanted: Array,
    radius: Array,
    configurations: Array,
    distances: Array,
) -> None:
    """Move configurations to within a radius of goals, by damped Newton steps.

    A row that ends makes room for the next one.

    Parameters
    ----------
    first, last, moving, chain
        Range of the rows, record of a `layout` as work space, and the arm.
    owner, radius : ndarray, shape (n_rows,)
        Row of goals and limits for each, and distance at which to stop [m].
    lower, upper, goals : ndarray, shape (n_goals, n) twice and (n_goals, 3)
        Limits of the first n joints, the others stay [rad or m]; goals [m].
    turn, wanted : Turn, and ndarray, shape (n_goals, n_axes, 3)
        Axes of the tool, and directions wanted of them. A distance is that of
        the tool or of its axes, whichever is larger.
    configurations, distances : ndarray, shape (n_rows, n_joints) and (n_rows,)
        Changed: joint positions [rad or m], and distances from tool to goal
        [m].
    """
    tool, rows = chain.tool, moving.rows
    n_joints, aim = configurations.shape[1], moving.goal[0]
    poses, jacobian, step, error = moving.poses, moving.jacobian, moving.step, moving.error
    # The numbers in the lanes.
    radii, directions = as_numbers(moving.radius), as_numbers(moving.wanted)
    found, iterations = as_numbers(moving.distance), as_numbers(moving.iteration)
    waiting, free = first, (1 << LANES) - 1
    while True:
        # Put the next rows into lanes that are free.
        for lane in range(LANES if waiting < last else 0):
            if free >> lane & 1 and waiting < last:
                goal, rows[lane] = owner[waiting], waiting
                put(configurations, waiting, moving.q, 0, lane)
                put(lower, goal, moving.lower, 0, lane)
                put(upper, goal, moving.upper, 0, lane)
                put(goals, goal, moving.goal, 0, lane)
                for b in range(directions.shape[0]):
                    for k in range(3):
                        directions[b, k, lane] = wanted[goal, b, k]
                radii[0, lane] = radius[waiting]
                iterations[0, lane] = 0.0
                waiting += 1
                free &= ~(1 << lane)
        if free == (1 << LANES) - 1:
            return
        # Measure the distance to the goal, and take out what is close enough.
        forward_kinematics(chain, moving.q, 0, poses)
        point = to_world(poses, n_joints, tool[0], tool[1], tool[2])
        x, y, z = aim[0] - point[0], aim[1] - point[1], aim[2] - point[2]
        distance = math.sqrt(x * x + y * y + z * z)
        moving.distance[0], apart = distance, distance
        point_jacobian(chain, poses, point, jacobian)
        if jacobian.shape[0] > 3:
            tx, ty, tz = orientation_error(turn.axes, poses, moving.wanted, jacobian)
            apart = turn.weight * math.sqrt(tx * tx + ty * ty + tz * tz)
            moving.distance[0] = max(distance, apart)
        ended = (moving.distance[0] <= moving.radius[0]) | (moving.iteration[0] >= ITERATIONS)
        ended_bits = lane_bits(ended) & ~free
        for lane in range(LANES if ended_bits != 0 else 0):
            if ended_bits >> lane & 1:
                take(moving.q, 0, lane, configurations, rows[lane])
                distances[rows[lane]] = found[0, lane]
        free |= ended_bits
        # Aimed at half the radius, a short step still arrives. What has ended stays.
        share = select(ended, 0.0, 1.0 - 0.5 * moving.radius[0] / distance)
        limits, blocked = (moving.lower[0], moving.upper[0]), True
        if jacobian.shape[0] > 3:
            share, near = max(share, 0.0), max(1.0 - 0.5 * moving.radius[0] / apart, 0.0)
            near = select(ended, 0.0, turn.weight * near)
            error[0], error[1], error[2] = share * x, share * y, share * z
            error[3], error[4], error[5] = near * tx, near * ty, near * tz
            for i in range(3, 6):
                for k in range(jacobian.shape[1]):
                    jacobian[i, k] *= turn.weight
        while blocked:
            if jacobian.shape[0] > 3:
                damped_step_of_rows(jacobian, error, DAMPING + 0.0 * x, moving.square, step)
            else:
                damped_step(jacobian, (share * x, share * y, share * z), step)
            blocked = take_out_blocked(moving.q, *limits, step, jacobian)
        take_step(moving.q, *limits, step)
        moving.iteration[0] += 1.0
