"""Proofs for a box of configurations: distance from a goal, and contact.

A box has a centre c and half-widths h. With any unit vector u, the tool p and
the goal g,

    |p(c + e) - g|  >=  u . (p(c) - g) + sum_i u . J_i e_i + 1/2 sum_ij u . H_ij e_i e_j - R

for all |e_i| <= h_i, with the Jacobian J and the second derivatives H of the
tool, and a bound R of what is of third order. A second bound needs no tool: the
origin of the k-th joint moves no farther than its swing, and the tool is no
farther from it than its length.

Two points, of the axes of bodies or of a box or half-space, prove contact
throughout a box if they stay closer than the radii. Bodies that are only
enclosed by such shapes prove nothing.

No branch depends on values, so that lanes may hold a box each.
"""

import math

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain, MotionBounds
from kinarm.contact_shapes import BETWEEN_CAPSULES, WITH_BOX, ContactShapes
from kinarm.kernels.compiling import Array, Vector, helper, inlined
from kinarm.kernels.distance import between_segments, closest_to_box
from kinarm.kernels.kinematics import (
    forward_kinematics,
    point_jacobian,
    rotated_back,
    to_frame,
    to_world,
)
from kinarm.kernels.lanes import any_lane, select
from kinarm.kernels.overlap import is_exact, radius_of
from kinarm.kernels.planes import DEPTH, axis_in_world, surface

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
def closest_step(jacobian: Array, offset: Array, half: Array, step: Array, scale: Array) -> Vector:
    """Fill in the e in the box that nearly minimises |offset + J e|; return the vector.

    A descent, one joint at a time. It need not converge: the bound holds along any direction.
    ``scale``, shape (n,), is work space.
    """
    n = half.shape[0]
    x, y, z = offset[0], offset[1], offset[2]
    for i in range(n):
        jx, jy, jz = jacobian[0, i], jacobian[1, i], jacobian[2, i]
        square = jx * jx + jy * jy + jz * jz
        # A joint that does not move the tool stays where it is.
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
) -> float:
    """Lower bound of the distance over a box, along a direction.

    Filled in, shape (n,): the ``slope`` of each joint, the ``least`` that it adds to the bound, and
    how far it may ``bend`` below its slope.
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
            # The second derivative by a joint and a later one is the cross product of the first
            # one's axis with the other's motion.
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
    """Cut off what is beyond the cutoff; return the share that is left.

    Takes a bound of at most the cutoff, and what `curved_bound` filled in. A joint is cut where the
    bound exceeds the cutoff though all others add least.
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


TRIED = 5
"""Evenly spaced points of an axis tried as the deepest, beside the closest."""


@inlined
def distance_from_box(beyond: Vector) -> float:
    """Distance from a box of a point so far beyond it per axis; negative within."""
    x, y, z = beyond
    farthest = max(max(x, y), z)
    x, y, z = max(x, 0.0), max(y, 0.0), max(z, 0.0)
    return select(farthest <= 0.0, farthest, math.sqrt(x * x + y * y + z * z))


@inlined
def excess_over_box(point: Vector, lower: Vector, upper: Vector) -> Vector:
    """How far a point is beyond a box, per axis; negative between its faces."""
    return (
        max(lower[0] - point[0], point[0] - upper[0]),
        max(lower[1] - point[1], point[1] - upper[1]),
        max(lower[2] - point[2], point[2] - upper[2]),
    )


@inlined
def along(a: Vector, b: Vector, share: float) -> Vector:
    """Point of the segment ab."""
    return (
        a[0] + share * (b[0] - a[0]),
        a[1] + share * (b[1] - a[1]),
        a[2] + share * (b[2] - a[2]),
    )


@inlined
def deepest_share(a: Vector, b: Vector, lower: Vector, upper: Vector) -> float:
    """Where the segment ab is deepest in a box, or closest: the best of a few."""
    share = closest_to_box(a, b, lower, upper)
    least = distance_from_box(excess_over_box(along(a, b, share), lower, upper))
    for k in range(TRIED):
        tried = along(a, b, k / (TRIED - 1))
        distance = distance_from_box(excess_over_box(tried, lower, upper))
        share = select(distance < least, k / (TRIED - 1), share)
        least = min(distance, least)
    return share


@inlined
def axis_of(shapes: ContactShapes, i: int, poses: Array) -> tuple[Vector, Vector, float]:
    """End points of a capsule's axis in the world, and half its length."""
    a, b = axis_in_world(shapes, i, poses)
    x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    return a, b, 0.5 * math.sqrt(x * x + y * y + z * z)


@helper
def overlaps(
    wanted: bool,
    chain: Chain,
    shapes: ContactShapes,
    poses: Array,
    half: Array,
    share: float,
    jacobian: Array,
) -> bool:
    """Whether some pair of bodies is proven to touch throughout a box.

    Its centre has the ``poses``, its half-widths are ``share`` times ``half``. Only what is
    ``wanted`` is examined. The Jacobian, shape (3, n), is work space.
    """
    bodies, pairs, travel, prismatic = shapes.bodies, shapes.pairs, shapes.travel, chain.prismatic
    n = half.shape[0]
    proven: bool = wanted & (half[0] < 0.0)
    for pair in range(pairs.shape[0]):
        kind, i, j = pairs[pair, 0], pairs[pair, 1], pairs[pair, 2]
        if not is_exact(shapes, pair):
            continue
        a, b, reach = axis_of(shapes, i, poses)
        middle = along(a, b, 0.5)
        # Coal, whose iterations are no more precise, decides what just touches.
        radius = shapes.capsules[i, 6] - DEPTH
        if kind == BETWEEN_CAPSULES:
            c, d, beyond = axis_of(shapes, j, poses)
            other, radius = along(c, d, 0.5), radius + radius_of(shapes, j, poses)
            x, y, z = middle[0] - other[0], middle[1] - other[1], middle[2] - other[2]
            # Most pairs are far apart at the centre.
            reach += beyond + radius
            if not any_lane((x * x + y * y + z * z < reach * reach) & wanted & ~proven):
                continue
            x, y, z = between_segments(a, b, c, d)
            gap = math.sqrt(x * x + y * y + z * z)
            # No two points move apart by more than the travel of the pair.
            for axis in range(n):
                gap += share * half[axis] * travel[axis, pair]
            proven = proven | (wanted & (gap < radius))
            continue
        # A point deep in an obstacle stays in it longest; in a half-space, the lower end of the
        # segment is deepest. All of it along the edges of the box.
        frame, none = bodies[j, 2], 0.0 * poses[0, 13]
        nx, ny, nz, offset = surface(poses, frame)
        if kind == WITH_BOX:
            hx, hy, hz = poses[frame, 0], poses[frame, 1], poses[frame, 2]
            lower, upper = (-hx, -hy, -hz), (hx, hy, hz)
            c, d = to_frame(poses, frame, a), to_frame(poses, frame, b)
            centre = excess_over_box(along(c, d, 0.5), lower, upper)
            apart = distance_from_box(centre) >= radius + reach
            if not any_lane(wanted & ~proven & ~apart):
                continue
            deepest = deepest_share(c, d, lower, upper)
            point = along(a, b, deepest)
            x, y, z = excess_over_box(along(c, d, deepest), lower, upper)
        else:
            start, end = nx * a[0] + ny * a[1] + nz * a[2], nx * b[0] + ny * b[1] + nz * b[2]
            first = start < end
            point = select(first, a[0], b[0]), select(first, a[1], b[1]), select(first, a[2], b[2])
            x, y, z = none - np.inf, none - np.inf, select(first, start, end) - offset
        if not any_lane(wanted & ~proven & (distance_from_box((x, y, z)) < radius)):
            continue
        # The point's motion along each edge to first order: an arm that slides along an obstacle
        # does not leave it.
        point_jacobian(chain, poses, point, jacobian)
        remainder = 0.0 * half[0]
        for axis in range(min(n, bodies[i, 2])):
            width = share * half[axis]
            u, v, w = jacobian[0, axis], jacobian[1, axis], jacobian[2, axis]
            if kind == WITH_BOX:
                u, v, w = rotated_back(poses, frame, u, v, w)
                x, y = x + width * abs(u), y + width * abs(v)
            else:
                w = nx * u + ny * v + nz * w
            z += width * abs(w)
            # The rest is of second order: a revolute joint turns its own motion and that of every
            # later joint. A pair of joints counts once, a joint with itself by half.
            if not prismatic[axis]:
                later = 0.5 * width * travel[axis, pair]
                for other_axis in range(axis + 1, min(n, bodies[i, 2])):
                    later += share * half[other_axis] * travel[other_axis, pair]
                remainder += width * later
        proven = proven | (wanted & (distance_from_box((x, y, z)) + remainder < radius))
    return proven
