"""Proofs for a box of configurations: distance from a goal.

A box has a centre c and half-widths h. With any unit vector u, the tool p and
the goal g,

    |p(c + e) - g|  >=  u . (p(c) - g) + sum_i u . J_i e_i + 1/2 sum_ij u . H_ij e_i e_j - R

for all |e_i| <= h_i, with the Jacobian J and the second derivatives H of the
tool, and a bound R of what is of third order. A second bound needs no tool: the
origin of the k-th joint moves no farther than its swing, and the tool is no
farther from it than its length. Where rotation counts, p and g have further entries, the directions
of the tool's axes (`kinarm.policies.oracle.kernels.rotation`).

No branch depends on values, so that lanes may hold a box each.
"""

import math

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain, MotionBounds
from kinarm.kernels.compiling import Array, Vector, helper, inlined
from kinarm.kernels.kinematics import forward_kinematics, rotated, to_world
from kinarm.kernels.lanes import select
from kinarm.policies.oracle.kernels.rotation import (
    Turn,
    length_of,
    plus_axes,
    share_within,
    turned_by,
)

SWEEPS = 3
"""Passes of the descent over the joints."""

NEGLIGIBLE = 1e-12
"""Length, or its square, below which a vector has no direction [m, m^2]."""


@helper
def offset_from_goal(chain: Chain, q: Array, goal: Vector, poses: Array, offset: Array) -> float:
    """Fill in poses and vector from goal to tool; return its length [m]."""
    tool = chain.tool
    forward_kinematics(chain, q, 0, poses)
    x, y, z = to_world(poses, q.shape[1], tool[0], tool[1], tool[2])
    x, y, z = x - goal[0], y - goal[1], z - goal[2]
    offset[0], offset[1], offset[2] = x, y, z
    return math.sqrt(x * x + y * y + z * z)


@helper
def joint_bound(bounds: MotionBounds, poses: Array, goal: Vector, half: Array) -> float:
    """Lower bound of the distance over a box, by the joints."""
    swing, length = bounds.swing, bounds.length
    bound: float = 0.0 * half[0]
    for k in range(half.shape[0]):
        x, y, z = poses[k + 1, 13] - goal[0], poses[k + 1, 14] - goal[1], poses[k + 1, 15] - goal[2]
        # Only the joints up to it move its origin; its length covers the others.
        motion = 0.0 * half[0] + length[k]
        for i in range(k + 1):
            motion += half[i] * swing[i, k]
        bound = max(bound, math.sqrt(x * x + y * y + z * z) - motion)
    return bound


@helper
def closest_step(
    jacobian: Array,
    offset: Array,
    half: Array,
    step: Array,
    scale: Array,
    spin: Array,
    turned: Array,
    radius: float,
) -> Vector:
    """Fill in the e in the box that nearly minimises |offset + J e|; return the vector.

    A descent, one joint at a time. It need not converge: the bound holds along any direction.
    ``scale``, shape (n,), is work space. With axes, whose Jacobian is ``spin``, what the tool and
    the axes are beyond a ``radius`` is minimised. That of the axes goes from the first row of
    ``turned`` to the second one.
    """
    n, rows = half.shape[0], spin.shape[0]
    aside, within = turned[1], turned[2]
    x, y, z = offset[0], offset[1], offset[2]
    px, py, pz = 0.0 * x, 0.0 * x, 0.0 * x
    for i in range(n):
        jx, jy, jz = jacobian[0, i], jacobian[1, i], jacobian[2, i]
        square = jx * jx + jy * jy + jz * jz
        for k in range(rows):
            square += spin[k, i] * spin[k, i]
        # A joint that does not move the tool stays where it is.
        scale[i] = select(square > NEGLIGIBLE, 1.0 / square, 0.0)
        step[i] = 0.0
    for k in range(rows):
        aside[k], within[k] = turned[0, k], 0.0 * x
    for _ in range(SWEEPS):
        if rows > 0:
            x, y, z = x + px, y + py, z + pz
            share = share_within(math.sqrt(x * x + y * y + z * z), radius)
            px, py, pz = share * x, share * y, share * z
            x, y, z = x - px, y - py, z - pz
            for k in range(rows):
                aside[k] += within[k]
            share = share_within(length_of(aside), radius)
            for k in range(rows):
                within[k] = share * aside[k]
                aside[k] -= within[k]
        for i in range(n):
            jx, jy, jz = jacobian[0, i], jacobian[1, i], jacobian[2, i]
            along = plus_axes(x * jx + y * jy + z * jz, aside, spin, i)
            moved = step[i] - along * scale[i]
            moved = min(max(moved, -half[i]), half[i])
            change = moved - step[i]
            x, y, z = x + change * jx, y + change * jy, z + change * jz
            for k in range(rows):
                aside[k] += change * spin[k, i]
            step[i] = moved
    return x, y, z


@inlined
def third_order(prismatic: NDArray[np.bool_], curvature: Array, half: Array) -> float:
    """Bound of what is of third order in a box [m].

    A revolute joint turns its own second derivatives and those by later joints, at equal length; a
    prismatic one leaves them alone.
    """
    n = half.shape[0]
    before = 0.0 * half[0]
    rest: float = 0.0 * half[0]
    for i in range(n):
        # Six orders of three joints are the same if all differ, three if two do.
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
    turn: Turn,
    spin: Array,
    turned: Array,
) -> float:
    """Lower bound of the distance over a box, along a direction.

    Filled in, shape (n,): the ``slope`` of each joint, the ``least`` that it adds to the bound, and
    how far it may ``bend`` below its slope. With axes, the distance is the larger one of the tool
    and of these, whose entries are in ``turned`` (see `closest_step`).
    """
    n, rows = half.shape[0], spin.shape[0]
    apart, aside, twist = turned[0], turned[1], turned[2]
    x, y, z = direction
    norm = math.sqrt(x * x + y * y + z * z)
    if rows > 0:
        # The norm that goes with the larger of two lengths is their sum.
        norm += length_of(aside)
    # Where the model reaches the goal, no direction separates the box from it.
    scale: float = select(norm > NEGLIGIBLE, 1.0 / norm, 0.0)
    x, y, z = scale * x, scale * y, scale * z
    bound = x * offset[0] + y * offset[1] + z * offset[2]
    remainder = third_order(chain.prismatic, curvature, half)
    if rows > 0:
        share = math.sqrt(x * x + y * y + z * z)
        # No derivative of the axes is longer than they are.
        total = turned_by(turn, half)
        of_axes = turn.weight * total * total * total / 6.0
        remainder = share * remainder + (1.0 - share) * of_axes
        for k in range(rows):
            aside[k] = scale * aside[k]
            bound += aside[k] * apart[k]
    bound -= remainder
    for i in range(n):
        h = half[i]
        slope[i] = x * jacobian[0, i] + y * jacobian[1, i] + z * jacobian[2, i]
        slope[i] = plus_axes(slope[i], aside, spin, i)
        size = abs(slope[i])
        least[i], bend[i] = -size * h, 0.0
        if not chain.prismatic[i]:
            # The second derivative by a joint and a later one is the cross product of the first
            # one's axis with the other's motion.
            ax, ay, az = chain.axis[i, 0], chain.axis[i, 1], chain.axis[i, 2]
            wx, wy, wz = rotated(poses, i + 1, ax, ay, az)
            tx, ty, tz = y * wz - z * wy, z * wx - x * wz, x * wy - y * wx
            second = tx * jacobian[0, i] + ty * jacobian[1, i] + tz * jacobian[2, i]
            for k in range(0, rows, 3):
                u, v, w = aside[k], aside[k + 1], aside[k + 2]
                twist[k], twist[k + 1] = v * wz - w * wy, w * wx - u * wz
                twist[k + 2] = u * wy - v * wx
            second = plus_axes(second, twist, spin, i)
            at_end = 0.5 * second * h * h
            # A parabola that opens upwards may be lowest within the box.
            within = size < second * h
            least[i] = select(within, -0.5 * size * size / second, at_end - size * h)
            bend[i] = min(at_end, 0.0)
            for j in range(i + 1, n):
                mixed = tx * jacobian[0, j] + ty * jacobian[1, j] + tz * jacobian[2, j]
                mixed = plus_axes(mixed, twist, spin, j)
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
    box: Array,
) -> float:
    """Cut off what is beyond the cutoff of a box, shape (1, 2 n); return the share that is left.

    Takes a bound of at most the cutoff, and what `curved_bound` filled in. A joint is cut where the
    bound exceeds the cutoff though all others add least.
    """
    n, share = half.shape[0], 0.0 * half[0] + 1.0
    for i in range(n):
        size, h = abs(slope[i]), half[i]
        allowed = cutoff - (bound - least[i]) - bend[i]
        end = max(select(size * h > allowed, allowed / size, h), -h)
        lower, upper = box[0, i], box[0, n + i]
        upper = select(slope[i] > 0.0, min(upper, q[0, i] + end), upper)
        lower = select(slope[i] < 0.0, max(lower, q[0, i] - end), lower)
        box[0, i], box[0, n + i] = lower, upper
        share *= select(h > 0.0, 0.5 * (upper - lower) / h, 1.0)
    return share
