"""Proof that the arm touches something throughout a box of configurations.

Two points prove it, one of each body's axis, or of obstacle or ground, that stay closer than the
radii however the arm moves in the box. Bodies that are only enclosed by a capsule prove nothing.
"""

import math

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.contact_shapes import BETWEEN_CAPSULES, WITH_BOX, ContactShapes
from kinarm.kernels.compiling import helper, inlined
from kinarm.kernels.distance import between_segments, closest_to_box
from kinarm.kernels.kinematics import point_jacobian, to_world
from kinarm.kernels.proof import MARGIN

TRIED = 5
"""Evenly spaced points of an axis that are tried for the deepest one, beside the closest one."""


@inlined
def distance_from_box(x: float, y: float, z: float) -> float:
    """Distance from a box, given how far a point is beyond it per axis; less than 0 within."""
    if x <= 0.0 and y <= 0.0 and z <= 0.0:
        return max(x, y, z)
    x, y, z = max(x, 0.0), max(y, 0.0), max(z, 0.0)
    return math.sqrt(x * x + y * y + z * z)


@inlined
def excess_over_box(
    point: tuple[float, float, float],
    lower: tuple[float, float, float],
    upper: tuple[float, float, float],
) -> tuple[float, float, float]:
    """How far a point is beyond a box, per axis; less than 0 between its faces."""
    return (
        max(lower[0] - point[0], point[0] - upper[0]),
        max(lower[1] - point[1], point[1] - upper[1]),
        max(lower[2] - point[2], point[2] - upper[2]),
    )


@inlined
def deepest_point(
    a: tuple[float, float, float],
    b: tuple[float, float, float],
    lower: tuple[float, float, float],
    upper: tuple[float, float, float],
) -> tuple[float, float, float]:
    """Point of the segment ab that is deepest in a box, or closest to it: the best of a few."""
    best, share = np.inf, 0.0
    for k in range(TRIED + 1):
        t = k / (TRIED - 1) if k < TRIED else closest_to_box(a, b, lower, upper)
        x, y, z = a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])
        ex, ey, ez = excess_over_box((x, y, z), lower, upper)
        distance = distance_from_box(ex, ey, ez)
        if distance < best:
            best, share = distance, t
    return (
        a[0] + share * (b[0] - a[0]),
        a[1] + share * (b[1] - a[1]),
        a[2] + share * (b[2] - a[2]),
    )


@inlined
def capsules_overlap(
    a: tuple[float, float, float],
    b: tuple[float, float, float],
    c: tuple[float, float, float],
    d: tuple[float, float, float],
    radii: tuple[float, float],
    pair: int,
    travel: NDArray[np.float64],
    half: NDArray[np.float64],
    share: float,
) -> bool:
    """Whether capsules about the segments ab and cd overlap throughout a box.

    No two of their points move apart by more than the travel of the pair.
    """
    x, y, z = between_segments(a, b, c, d)
    gap = math.sqrt(x * x + y * y + z * z) - radii[1]
    for axis in range(half.shape[0]):
        gap += share * half[axis] * travel[axis, pair]
    return gap < radii[0]


@helper
def overlaps(
    chain: Chain,
    shapes: ContactShapes,
    poses: NDArray[np.float64],
    half: NDArray[np.float64],
    share: float,
    jacobian: NDArray[np.float64],
) -> bool:
    """Whether some pair of bodies is proven to touch throughout a box of configurations.

    The box is centred where the ``poses`` are, with half-widths ``share`` times ``half``; a share
    of 0 leaves its centre alone. The Jacobian, shape (3, n), is work space.
    """
    prismatic, axes = chain.prismatic, chain.axis
    link, capsules, boxes, pairs, travel, exact = shapes
    n = half.shape[0]
    for pair in range(pairs.shape[0]):
        kind, i, j = pairs[pair, 0], pairs[pair, 1], pairs[pair, 2]
        if not exact[i] or (kind == BETWEEN_CAPSULES and not exact[j]):
            continue
        a = to_world(poses, link[i], capsules[i, 0], capsules[i, 1], capsules[i, 2])
        b = to_world(poses, link[i], capsules[i, 3], capsules[i, 4], capsules[i, 5])
        # What only just touches is left to Coal, whose iterations are no more precise.
        radius = capsules[i, 6] - MARGIN
        if kind == BETWEEN_CAPSULES:
            c = to_world(poses, link[j], capsules[j, 0], capsules[j, 1], capsules[j, 2])
            d = to_world(poses, link[j], capsules[j, 3], capsules[j, 4], capsules[j, 5])
            radii = (radius, capsules[j, 6])
            if capsules_overlap(a, b, c, d, radii, pair, travel, half, share):
                return True
            continue
        # A point deep in an obstacle stays in it longest. The ground is a box without end, of which
        # the lower end of the segment is the deepest point.
        lower, upper = (-np.inf, -np.inf, -np.inf), (np.inf, np.inf, 0.0)
        point = a if a[2] < b[2] else b
        if kind == WITH_BOX:
            lower = (boxes[j, 0, 0], boxes[j, 0, 1], boxes[j, 0, 2])
            upper = (boxes[j, 1, 0], boxes[j, 1, 1], boxes[j, 1, 2])
            point = deepest_point(a, b, lower, upper)
        x, y, z = excess_over_box(point, lower, upper)
        # Most pairs are apart at the centre already: no need to bound how the point moves.
        if distance_from_box(x, y, z) >= radius:
            continue
        # The point's motion along each world axis to first order, by its Jacobian: an arm that
        # slides along an obstacle does not leave it, however far it goes.
        point_jacobian(prismatic, axes, poses, point, jacobian)
        remainder = 0.0
        for axis in range(min(n, link[i])):
            width = share * half[axis]
            x += width * abs(jacobian[0, axis])
            y += width * abs(jacobian[1, axis])
            z += width * abs(jacobian[2, axis])
            # The rest is of second order: a revolute joint turns its own motion, and that of every
            # later joint, by its angle. A pair of joints counts once, a joint with itself by half.
            if not prismatic[axis]:
                later = 0.5 * width * travel[axis, pair]
                for other in range(axis + 1, min(n, link[i])):
                    later += share * half[other] * travel[other, pair]
                remainder += width * later
        if distance_from_box(x, y, z) + remainder < radius:
            return True
    return False
