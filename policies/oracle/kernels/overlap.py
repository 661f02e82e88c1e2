"""Proof that the arm touches something throughout a box of configurations.

Two points prove it, one of each body's axis, or of obstacle or ground, that stay closer than the
radii however the arm moves in the box. Bodies that are only enclosed by a capsule prove nothing.

All of it is free of branches on values, for a box or for one in each lane.
"""

import math

import numpy as np

from kinarm.chain import Chain
from kinarm.contact_shapes import BETWEEN_CAPSULES, WITH_BOX, ContactShapes
from kinarm.kernels.compiling import Array, Vector, helper, inlined
from kinarm.kernels.distance import between_segments, closest_to_box, turned_back
from kinarm.kernels.kinematics import point_jacobian
from kinarm.kernels.lanes import any_lane, select
from kinarm.kernels.planes import axis_in_world
from kinarm.kernels.proof import MARGIN, is_exact

TRIED = 5
"""Evenly spaced points of an axis that are tried for the deepest one, beside the closest one."""


@inlined
def distance_from_box(beyond: Vector) -> float:
    """Distance from a box, given how far a point is beyond it per axis; less than 0 within."""
    x, y, z = beyond
    farthest = max(max(x, y), z)
    x, y, z = max(x, 0.0), max(y, 0.0), max(z, 0.0)
    return select(farthest <= 0.0, farthest, math.sqrt(x * x + y * y + z * z))


@inlined
def excess_over_box(point: Vector, lower: Vector, upper: Vector) -> Vector:
    """How far a point is beyond a box, per axis; less than 0 between its faces."""
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
    """Where on the segment ab it is deepest in a box, or closest to it: the best of a few."""
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
    """End points of a capsule's axis in the world, and half their distance."""
    axis = shapes.capsules[i]
    a, b = axis_in_world(shapes, i, poses)
    x, y, z = axis[3] - axis[0], axis[4] - axis[1], axis[5] - axis[2]
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
    """Whether some pair of bodies is proven to touch throughout a box of configurations.

    The box is centred where the ``poses`` are, with half-widths ``share`` times ``half``; a share
    of 0 leaves its centre alone. Only what is ``wanted`` is examined. The Jacobian, shape (3, n),
    is work space.
    """
    bodies, capsules, boxes, turns = shapes.bodies, shapes.capsules, shapes.boxes, shapes.turns
    prismatic, pairs, travel = chain.prismatic, shapes.pairs, shapes.travel
    n = half.shape[0]
    proven: bool = wanted & (half[0] < 0.0)
    for pair in range(pairs.shape[0]):
        kind, i, j = pairs[pair, 0], pairs[pair, 1], pairs[pair, 2]
        if not is_exact(shapes, pair):
            continue
        a, b, reach = axis_of(shapes, i, poses)
        middle = along(a, b, 0.5)
        # What only just touches is left to Coal, whose iterations are no more precise.
        radius = capsules[i, 6] - MARGIN
        if kind == BETWEEN_CAPSULES:
            c, d, beyond = axis_of(shapes, j, poses)
            other, radius = along(c, d, 0.5), radius + capsules[j, 6]
            x, y, z = middle[0] - other[0], middle[1] - other[1], middle[2] - other[2]
            # Most pairs are far apart at the centre already.
            reach += beyond + radius
            if not any_lane((x * x + y * y + z * z < reach * reach) & wanted & ~proven):
                continue
            x, y, z = between_segments(a, b, c, d)
            gap = math.sqrt(x * x + y * y + z * z)
            # No two points of the bodies move apart by more than the travel of the pair.
            for axis in range(n):
                gap += share * half[axis] * travel[axis, pair]
            proven = proven | (wanted & (gap < radius))
            continue
        # A point deep in an obstacle stays in it longest. The ground is a box without end, of which
        # the lower end of the segment is the deepest point.
        lower, upper = (-np.inf, -np.inf, -np.inf), (np.inf, np.inf, 0.0)
        first = a[2] < b[2]
        point = select(first, a[0], b[0]), select(first, a[1], b[1]), select(first, a[2], b[2])
        cosine, sine = 1.0, 0.0
        if kind == WITH_BOX:
            # All of it along the edges of the box.
            cosine, sine = turns[j, 0], turns[j, 1]
            c, d = turned_back(a, cosine, sine), turned_back(b, cosine, sine)
            lower = (boxes[j, 0, 0], boxes[j, 0, 1], boxes[j, 0, 2])
            upper = (boxes[j, 1, 0], boxes[j, 1, 1], boxes[j, 1, 2])
            centre = excess_over_box(along(c, d, 0.5), lower, upper)
            apart = distance_from_box(centre) >= radius + reach
            if not any_lane(wanted & ~proven & ~apart):
                continue
            point = along(a, b, deepest_share(c, d, lower, upper))
        x, y, z = excess_over_box(turned_back(point, cosine, sine), lower, upper)
        if not any_lane(wanted & ~proven & (distance_from_box((x, y, z)) < radius)):
            continue
        # The point's motion along each edge to first order, by its Jacobian: an arm that
        # slides along an obstacle does not leave it, however far it goes.
        point_jacobian(chain, poses, point, jacobian)
        remainder = 0.0 * half[0]
        for axis in range(min(n, bodies[i, 2])):
            width = share * half[axis]
            speed = (jacobian[0, axis], jacobian[1, axis], jacobian[2, axis])
            speed = turned_back(speed, cosine, sine)
            x += width * abs(speed[0])
            y += width * abs(speed[1])
            z += width * abs(speed[2])
            # The rest is of second order: a revolute joint turns its own motion, and that of every
            # later joint, by its angle. A pair of joints counts once, a joint with itself by half.
            if not prismatic[axis]:
                later = 0.5 * width * travel[axis, pair]
                for other_axis in range(axis + 1, min(n, bodies[i, 2])):
                    later += share * half[other_axis] * travel[other_axis, pair]
                remainder += width * later
        proven = proven | (wanted & (distance_from_box((x, y, z)) + remainder < radius))
    return proven
