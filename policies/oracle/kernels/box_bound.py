"""Lower bounds of the distance from the tool to a goal over a box of configurations.

A box has a centre c and half-widths h. With any unit vector u, the tool p and the goal g,

    |p(c + e) - g|  >=  u . (p(c) - g) - sum_i |u . J_i| h_i - 1/2 sum_ij curvature_ij h_i h_j

for all |e_i| <= h_i: the component along u is no longer than the vector, the Jacobian J says how
the component changes to first order, and the curvature bounds the rest. A second bound needs no
tool: the origin of the k-th joint moves no farther than its swing, and the tool is no farther from
it than its length.
"""

import math

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.kernels.compiling import helper, inlined
from kinarm.kernels.kinematics import forward_kinematics, to_world
from kinarm.motion_bounds import MotionBounds

SWEEPS = 8
"""Passes of the descent over the joints."""

NEGLIGIBLE = 1e-12
"""Length, and square of one, below which a vector has no direction to speak of [m, m^2]."""


@helper
def offset_from_goal(
    chain: Chain,
    q: NDArray[np.float64],
    goal: tuple[float, float, float],
    poses: NDArray[np.float64],
    offset: NDArray[np.float64],
) -> float:
    """Fill in poses and the vector from the goal to the tool; return its length [m]."""
    prismatic, translation, rotation, axis, tool = chain[:5]
    forward_kinematics(prismatic, translation, rotation, axis, q, 0, poses)
    x, y, z = to_world(poses, q.shape[1], tool[0], tool[1], tool[2])
    offset[0], offset[1], offset[2] = x - goal[0], y - goal[1], z - goal[2]
    return math.sqrt(offset[0] * offset[0] + offset[1] * offset[1] + offset[2] * offset[2])


@inlined
def joint_bound(
    bounds: MotionBounds,
    poses: NDArray[np.float64],
    goal: tuple[float, float, float],
    half: NDArray[np.float64],
) -> float:
    """Lower bound of the distance over a box, from where the joints can be."""
    swing, length = bounds.swing, bounds.length
    bound = 0.0
    for k in range(half.shape[0]):
        x, y, z = poses[k + 1, 13] - goal[0], poses[k + 1, 14] - goal[1], poses[k + 1, 15] - goal[2]
        # Only the joints up to a joint move its origin; those beyond it are in its length.
        motion = length[k]
        for i in range(k + 1):
            motion += half[i] * swing[i, k]
        bound = max(bound, math.sqrt(x * x + y * y + z * z) - motion)
    return bound


@inlined
def linear_bound(
    jacobian: NDArray[np.float64],
    offset: NDArray[np.float64],
    half: NDArray[np.float64],
    enough: float,
    step: NDArray[np.float64],
) -> float:
    """Lower bound of |offset + J e| over |e_i| <= half_i, and the e that nearly attains it.

    A descent, one joint at a time, moves e to where the linear model comes closest to the goal.
    What remains there points in the direction u of the best bound, but the bound holds for any
    u: the descent need not have converged. It stops as soon as the bound exceeds ``enough``.
    """
    n = half.shape[0]
    x, y, z = offset[0], offset[1], offset[2]
    bound = 0.0
    for i in range(n):
        step[i] = 0.0
    for _ in range(SWEEPS):
        norm = math.sqrt(x * x + y * y + z * z)
        # The model reaches the goal: no direction separates the box from it.
        if norm < NEGLIGIBLE:
            break
        # u is (x, y, z) / norm; the division is left to the end.
        gap = x * offset[0] + y * offset[1] + z * offset[2]
        for i in range(n):
            gap -= half[i] * abs(x * jacobian[0, i] + y * jacobian[1, i] + z * jacobian[2, i])
        bound = max(bound, gap / norm)
        if bound > enough:
            break
        for i in range(n):
            jx, jy, jz = jacobian[0, i], jacobian[1, i], jacobian[2, i]
            square = jx * jx + jy * jy + jz * jz
            # A joint that does not move the tool, such as one through it, stays where it is.
            if square > NEGLIGIBLE:
                moved = step[i] - (x * jx + y * jy + z * jz) / square
                moved = min(max(moved, -half[i]), half[i])
                x += (moved - step[i]) * jx
                y += (moved - step[i]) * jy
                z += (moved - step[i]) * jz
                step[i] = moved
    return bound


@inlined
def model_error(
    curvature: NDArray[np.float64], half: NDArray[np.float64], parts: NDArray[np.float64]
) -> float:
    """Bound of what the linear model misses in a box [m], and what each joint has part in it."""
    error = 0.0
    for i in range(half.shape[0]):
        parts[i] = 0.0
        for j in range(half.shape[0]):
            parts[i] += curvature[i, j] * half[j]
        parts[i] *= half[i]
        error += 0.5 * parts[i]
    return error
