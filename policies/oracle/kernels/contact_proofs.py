"""Proofs for a box of configurations: contact throughout it.

Two points, of the axes of bodies or of a box or half-space, prove contact
throughout a box if they stay closer than the radii. Bodies of the arm count as
the capsules that lie in them.

No branch depends on values, so that lanes may hold a box each.
"""

import math

import numpy as np

from kinarm.chain import Chain
from kinarm.contact_shapes import BETWEEN_CAPSULES, WITH_BOX, ContactShapes
from kinarm.kernels.compiling import Array, Vector, helper, inlined
from kinarm.kernels.distance import between_segments, closest_to_box
from kinarm.kernels.kinematics import point_jacobian, rotated_back, to_frame
from kinarm.kernels.lanes import any_lane, select
from kinarm.kernels.planes import DEPTH, axis_in_world, radius_of, surface

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
def excess_over_box(point: Vector, half: Vector) -> Vector:
    """How far a point is beyond a box about the origin, per axis; negative between its faces."""
    return abs(point[0]) - half[0], abs(point[1]) - half[1], abs(point[2]) - half[2]


@inlined
def along(a: Vector, b: Vector, share: float) -> Vector:
    """Point of the segment ab."""
    return (
        a[0] + share * (b[0] - a[0]),
        a[1] + share * (b[1] - a[1]),
        a[2] + share * (b[2] - a[2]),
    )


@inlined
def deepest_share(a: Vector, b: Vector, half: Vector) -> float:
    """Where the segment ab is deepest in a box about the origin, or closest: the best of a few."""
    share = closest_to_box(a, b, (-half[0], -half[1], -half[2]), half)
    least = distance_from_box(excess_over_box(along(a, b, share), half))
    for k in range(TRIED):
        tried = along(a, b, k / (TRIED - 1))
        distance = distance_from_box(excess_over_box(tried, half))
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
    for pair in range(travel.shape[1]):
        kind, i, j = pairs[pair, 0], pairs[pair, 1], pairs[pair, 2]
        if kind != BETWEEN_CAPSULES and not shapes.exact[j]:
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
            size = poses[frame, 0], poses[frame, 1], poses[frame, 2]
            c, d = to_frame(poses, frame, a), to_frame(poses, frame, b)
            apart = distance_from_box(excess_over_box(along(c, d, 0.5), size)) >= radius + reach
            if not any_lane(wanted & ~proven & ~apart):
                continue
            deepest = deepest_share(c, d, size)
            point = along(a, b, deepest)
            x, y, z = excess_over_box(along(c, d, deepest), size)
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
