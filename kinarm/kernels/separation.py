"""The best separating plane of two bodies: the distance algorithm of Gilbert, Johnson and Keerthi.

It looks for the point closest to the origin of all differences of a point of the mover and one of
the carrier, in the frame that carries the latter: in a simplex of at most four of their corners'
differences, which is renewed by the corners that lie lowest along the way found so far.
"""

import math

import numpy as np
from numpy.typing import NDArray

from kinarm.contact_shapes import ContactShapes
from kinarm.kernels.compiling import Array, helper, inlined
from kinarm.kernels.distance import shrink
from kinarm.kernels.kinematics import rotated_back
from kinarm.kernels.planes import FINE, GAP, OFFSET

CORNERS_TRIED = 24
"""Corners after which the search ends."""

CLOSE = 1e-7
"""Precision of the distance [m]."""

COARSE = 0.02
"""Precision of the distance, where bodies are far apart, as a share of it."""


@inlined
def lowest_corner(
    corners: Array, spans: NDArray[np.int64], body: int, x: float, y: float, z: float
) -> int:
    """Row of the corner of a body that lies lowest along a vector of its joint frame.

    The first two columns of ``spans`` are each body's first row and the one after its last.
    """
    found, least = spans[body, 0], math.inf
    for i in range(spans[body, 0], spans[body, 1]):
        height = x * corners[i, 0] + y * corners[i, 1] + z * corners[i, 2]
        if height < least:
            found, least = i, height
    return found


@helper
def separate(
    shapes: ContactShapes,
    pair: int,
    poses: Array,
    relative: Array,
    simplex: Array,
    plane: Array,
) -> float:
    """Find a plane that separates a pair well, and return the height of its mover above it [m].

    Takes poses of numbers. The plane, shape (1, PLANE), is where the search begins, and is
    replaced by a better one. ``relative``, shape (1, POSE), and ``simplex``, shape (4, 3), are work
    space.
    """
    carrier, mover = shapes.proxies[pair, FINE, 0], shapes.proxies[pair, FINE, 1]
    base, link = shapes.bodies[carrier, 2], shapes.bodies[mover, 2]
    # The pose of the mover's frame in the carrier's.
    for k in range(3):
        relative[0, 4 + k], relative[0, 7 + k], relative[0, 10 + k] = rotated_back(
            poses, base, poses[link, 4 + k], poses[link, 7 + k], poses[link, 10 + k]
        )
    relative[0, 13], relative[0, 14], relative[0, 15] = rotated_back(
        poses,
        base,
        poses[link, 13] - poses[base, 13],
        poses[link, 14] - poses[base, 14],
        poses[link, 15] - poses[base, 15],
    )
    corners, rounding = shapes.corners, shapes.rounding[carrier] + shapes.rounding[mover]
    nx, ny, nz = plane[0, 0], plane[0, 1], plane[0, 2]
    best, size, norm = -math.inf, 0, math.inf
    for _ in range(CORNERS_TRIED):
        # The mover's corner that lies lowest, and the carrier's that lies highest.
        x, y, z = rotated_back(relative, 0, nx, ny, nz)
        low = lowest_corner(shapes.corners, shapes.bodies, mover, x, y, z)
        high = lowest_corner(shapes.corners, shapes.bodies, carrier, -nx, -ny, -nz)
        x, y, z = corners[low, 0], corners[low, 1], corners[low, 2]
        wx = relative[0, 13] + relative[0, 4] * x + relative[0, 5] * y + relative[0, 6] * z
        wy = relative[0, 14] + relative[0, 7] * x + relative[0, 8] * y + relative[0, 9] * z
        wz = relative[0, 15] + relative[0, 10] * x + relative[0, 11] * y + relative[0, 12] * z
        above = nx * corners[high, 0] + ny * corners[high, 1] + nz * corners[high, 2]
        gap = nx * wx + ny * wy + nz * wz - above
        wx, wy, wz = wx - corners[high, 0], wy - corners[high, 1], wz - corners[high, 2]
        if gap > best:
            best = gap
            plane[0, 0], plane[0, 1], plane[0, 2] = nx, ny, nz
            plane[0, OFFSET] = above + shapes.rounding[carrier]
        missing = norm - max(best, 0.0)
        if missing <= CLOSE or missing <= COARSE * (best - rounding) or norm <= rounding:
            break
        simplex[size, 0], simplex[size, 1], simplex[size, 2] = wx, wy, wz
        size, x, y, z = shrink(simplex, size + 1)
        norm = math.sqrt(x * x + y * y + z * z)
        if norm < CLOSE:
            break
        nx, ny, nz = x / norm, y / norm, z / norm
    plane[0, GAP] = best - rounding
    return best - rounding
