"""Inverse kinematics: configurations moved until they bring the tool to a goal, within limits."""

import math

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.kernels.compiling import inlined, kernel
from kinarm.kernels.kinematics import POSE, forward_kinematics, point_jacobian, to_world

LAYOUT = "82154f075c74"
"""Hash of what is compiled in from other files; see `kinarm.kernels.rollout.LAYOUT`."""

ITERATIONS = 24
"""Newton steps before a configuration is given up."""

DAMPING = 1e-4
"""Added to the diagonal of J J^T, which limits steps near singular configurations [m^2]."""

LONGEST_STEP = 0.5
"""Largest move of a joint in an iteration [rad or m]."""


@inlined
def damped_step(
    jacobian: NDArray[np.float64],
    vector: tuple[float, float, float],
    step: NDArray[np.float64],
) -> None:
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


@kernel
def damped_least_squares(
    first: int,
    last: int,
    chain: Chain,
    owner: NDArray[np.int64],
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    goals: NDArray[np.float64],
    radius: NDArray[np.float64],
    configurations: NDArray[np.float64],
    distances: NDArray[np.float64],
) -> None:
    """Move configurations until the tool is within a radius of the goal, by damped Newton steps.

    For rows ``first`` to ``last``, ``configurations`` are changed in place, and ``distances`` from
    the tool to the goal written [m]. ``owner`` says which row of goals and limits (of the first n
    joints; the others stay) belongs to each, and ``radius`` at which distance it is left [m].
    """
    prismatic, translation, rotation, axis, tool = chain[:5]
    n_joints, n = configurations.shape[1], lower.shape[1]
    poses, jacobian, step = np.empty((n_joints + 1, POSE)), np.empty((3, n)), np.empty(n)
    q = configurations
    for row in range(first, last):
        goal = owner[row]
        for iteration in range(ITERATIONS + 1):
            forward_kinematics(prismatic, translation, rotation, axis, q, row, poses)
            x, y, z = to_world(poses, n_joints, tool[0], tool[1], tool[2])
            dx, dy, dz = goals[goal, 0] - x, goals[goal, 1] - y, goals[goal, 2] - z
            distance = math.sqrt(dx * dx + dy * dy + dz * dz)
            distances[row] = distance
            if distance <= radius[row] or iteration == ITERATIONS:
                break
            point_jacobian(prismatic, axis, poses, (x, y, z), jacobian)
            # Aimed at half the radius, a step that falls short still arrives.
            share = 1.0 - 0.5 * radius[row] / distance
            # A joint that rests on a limit and would leave it is taken out of the Jacobian, so that
            # the others make up for it. That changes their steps: until none is blocked.
            blocked = True
            while blocked:
                blocked = False
                damped_step(jacobian, (share * dx, share * dy, share * dz), step)
                for k in range(n):
                    outward = (q[row, k] >= upper[goal, k] and step[k] > 0.0) or (
                        q[row, k] <= lower[goal, k] and step[k] < 0.0
                    )
                    if outward:
                        jacobian[0, k], jacobian[1, k], jacobian[2, k] = 0.0, 0.0, 0.0
                        blocked = True
            # Scaled down as a whole, a step keeps its direction, in which the tool nears the goal.
            longest = LONGEST_STEP
            for k in range(n):
                longest = max(longest, abs(step[k]))
            for k in range(n):
                moved = q[row, k] + LONGEST_STEP / longest * step[k]
                q[row, k] = min(max(moved, lower[goal, k]), upper[goal, k])
