"""Lower bounds of the distance from the tool to a goal over a box of configurations.

A box has a centre c and half-widths h. With any unit vector u, the tool p and the goal g,

    |p(c + e) - g|  >=  u . (p(c) - g) + sum_i u . J_i e_i + 1/2 sum_ij u . H_ij e_i e_j - R

for all |e_i| <= h_i: the component along u is no longer than the vector, the Jacobian J and the
second derivatives H say how the component changes, and R bounds what is of third order. A second
bound needs no tool: the origin of the k-th joint moves no farther than its swing, and the tool is
no farther from it than its length.

All of it is free of branches on values, for a box or for one in each lane.
"""

import math

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain, MotionBounds
from kinarm.kernels.compiling import Array, Vector, helper, inlined
from kinarm.kernels.kinematics import place, to_world
from kinarm.kernels.lanes import select

SWEEPS = 3
"""Passes of the descent over the joints."""

NEGLIGIBLE = 1e-12
"""Length, and square of one, below which a vector has no direction to speak of [m, m^2]."""


@helper
def offset_from_goal(chain: Chain, q: Array, goal: Vector, poses: Array, offset: Array) -> float:
    """Fill in poses and the vector from the goal to the tool; return its length [m]."""
    tool = chain.tool
    place(chain, q, poses)
    x, y, z = to_world(poses, q.shape[1], tool[0], tool[1], tool[2])
    x, y, z = x - goal[0], y - goal[1], z - goal[2]
    offset[0], offset[1], offset[2] = x, y, z
    return math.sqrt(x * x + y * y + z * z)


@helper
def joint_bound(bounds: MotionBounds, poses: Array, goal: Vector, half: Array) -> float:
    """Lower bound of the distance over a box, from where the joints can be."""
    swing, length = bounds.swing, bounds.length
    bound: float = 0.0 * half[0]
    for k in range(half.shape[0]):
        x, y, z = poses[k + 1, 13] - goal[0], poses[k + 1, 14] - goal[1], poses[k + 1, 15] - goal[2]
        # Only the joints up to a joint move its origin; those beyond it are in its length.
        motion = 0.0 * half[0] + length[k]
        for i in range(k + 1):
            motion += half[i] * swing[i, k]
        bound = max(bound, math.sqrt(x * x + y * y + z * z) - motion)
    return bound


@helper
def closest_step(jacobian: Array, offset: Array, half: Array, step: Array, scale: Array) -> Vector:
    """Fill in the e, |e_i| <= half_i, for which |offset + J e| is nearly least; return the vector.

    A descent, one joint at a time. It need not have converged: along any direction the bound holds.
    ``scale``, shape (n,), is work space.
    """
    n = half.shape[0]
    x, y, z = offset[0], offset[1], offset[2]
    for i in range(n):
        jx, jy, jz = jacobian[0, i], jacobian[1, i], jacobian[2, i]
        square = jx * jx + jy * jy + jz * jz
        # A joint that does not move the tool, such as one through it, stays where it is.
        scale[i] = select(square > NEGLIGIBLE, 1.0 / square, 0.0)
        step[i] = 0.0
    for _ in range(SWEEPS):
        for i in range(n):
            jx, jy, jz = jacobian[0, i], jacobian[1, i], jacobian[2, i]
            moved = step[i] - (x * jx + y * jy + z * jz) * scale[i]
            moved = min(max(moved, -half[i]), half[i])
            change = moved - step[i]
            x, y, z = x + change * jx, y + change * jy, z + change * jz
            step[i] = moved
    return x, y, z


@inlined
def third_order(prismatic: NDArray[np.bool_], curvature: Array, half: Array) -> float:
    """Bound of what is of third order in a box [m].

    A revolute joint turns the second derivatives by later joints, and its own, without making
    them longer; a prismatic one leaves them alone.
    """
    n = half.shape[0]
    before = 0.0 * half[0]
    rest: float = 0.0 * half[0]
    for i in range(n):
        # Of triples of joints in any order, six are the same if all differ, three if two do.
        rest += curvature[i, i] * half[i] * half[i] * (0.5 * before + half[i] / 6.0)
        for j in range(i + 1, n):
            rest += curvature[i, j] * half[i] * half[j] * (before + 0.5 * half[i])
        if not prismatic[i]:
            before += half[i]
    return rest


@helper
def curved_bound(
    chain: Chain,
    curvature: Array,
    poses: Array,
    jacobian: Array,
    offset: Array,
    direction: Vector,
    half: Array,
    slope: Array,
    least: Array,
    bend: Array,
) -> float:
    """Lower bound of the distance over a box, along a direction.

    Filled in, shape (n,): the ``slope`` of each joint, the ``least`` that it adds to the bound, and
    how far its motion may ``bend`` below its slope.
    """
    n = half.shape[0]
    x, y, z = direction
    norm = math.sqrt(x * x + y * y + z * z)
    # Where the model reaches the goal, no direction separates the box from it.
    scale: float = select(norm > NEGLIGIBLE, 1.0 / norm, 0.0)
    x, y, z = scale * x, scale * y, scale * z
    bound = x * offset[0] + y * offset[1] + z * offset[2]
    bound -= third_order(chain.prismatic, curvature, half)
    for i in range(n):
        h = half[i]
        slope[i] = x * jacobian[0, i] + y * jacobian[1, i] + z * jacobian[2, i]
        size = abs(slope[i])
        least[i], bend[i] = -size * h, 0.0
        if not chain.prismatic[i]:
            # The second derivative by a joint and a later one is the cross product of the axis of
            # the one with the motion of the other.
            c, ax, ay, az = i + 1, chain.axis[i, 0], chain.axis[i, 1], chain.axis[i, 2]
            wx = poses[c, 4] * ax + poses[c, 5] * ay + poses[c, 6] * az
            wy = poses[c, 7] * ax + poses[c, 8] * ay + poses[c, 9] * az
            wz = poses[c, 10] * ax + poses[c, 11] * ay + poses[c, 12] * az
            tx, ty, tz = y * wz - z * wy, z * wx - x * wz, x * wy - y * wx
            second = tx * jacobian[0, i] + ty * jacobian[1, i] + tz * jacobian[2, i]
            at_end = 0.5 * second * h * h
            # A parabola that opens upwards may be lowest within the box.
            within = size < second * h
            least[i] = select(within, -0.5 * size * size / second, at_end - size * h)
            bend[i] = min(at_end, 0.0)
            for j in range(i + 1, n):
                mixed = tx * jacobian[0, j] + ty * jacobian[1, j] + tz * jacobian[2, j]
                bound -= abs(mixed) * h * half[j]
        bound += least[i]
    return bound


@helper
def trim(
    cutoff: float,
    bound: float,
    slope: Array,
    least: Array,
    bend: Array,
    q: Array,
    half: Array,
    lower: Array,
    upper: Array,
) -> float:
    """Cut off what a box has beyond the cutoff; return which share of it is left.

    Takes a bound of at most the cutoff, and what `curved_bound` filled in. With the other joints
    wherever they add least, a joint alone may take the bound beyond the cutoff.
    """
    share: float = 0.0 * half[0] + 1.0
    for i in range(half.shape[0]):
        size, h = abs(slope[i]), half[i]
        allowed = cutoff - (bound - least[i]) - bend[i]
        end = max(select(size * h > allowed, allowed / size, h), -h)
        upper[i] = select(slope[i] > 0.0, min(upper[i], q[0, i] + end), upper[i])
        lower[i] = select(slope[i] < 0.0, max(lower[i], q[0, i] - end), lower[i])
        share *= select(h > 0.0, 0.5 * (upper[i] - lower[i]) / h, 1.0)
    return share
