"""The two closest bodies of a configuration and their closest points.

For rounded polytopes, the algorithm of Gilbert, Johnson and Keerthi finds the point closest to the
origin of all differences of their points.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.kernels.compiling import Array, Vector, helper, inlined, kernel
from kinarm.kernels.distance import of_segment, of_triangle, shrink
from kinarm.kernels.kinematics import POSE, forward_kinematics, rotated_back, to_world

CORNERS_TRIED = 64
"""Corners at which a distance is taken as it is."""

PRECISION = 1e-11
"""Largest excess of a distance [m]."""

OVERLAPPING = 1e-8
"""Distance below which polytopes, without rounding, overlap [m]."""


class Bodies(NamedTuple):
    """Bodies as rounded polytopes, and their tested pairs.

    Attributes
    ----------
    link : ndarray of int, shape (n,)
        Joint frame of a body; 0 is the world.
    span : ndarray of int, shape (n, 2)
        Its first corner, and the one after its last.
    corners : ndarray, shape (n_corners, 3)
        Corners in the joint frame [m]; of a half-space, its outer normal.
    rounding : ndarray, shape (n,)
        Radius that widens the hull of the corners [m]; of a half-space, its
        offset.
    flat : ndarray of bool, shape (n,)
        Whether it is a half-space.
    exact : ndarray of bool, shape (n,)
        Whether it equals the shape.
    balls : ndarray, shape (n, 4)
        Centre and radius of a ball about the body [m].
    pairs : ndarray of int, shape (n_pairs, 2)
        The two bodies; a half-space is the second one.
    """

    link: NDArray[np.int64]
    span: NDArray[np.int64]
    corners: Array
    rounding: Array
    flat: NDArray[np.bool_]
    exact: NDArray[np.bool_]
    balls: Array
    pairs: NDArray[np.int64]


@inlined
def lowest_in_world(bodies: Bodies, body: int, poses: Array, x: float, y: float, z: float) -> int:
    """Row of a body's corner that is lowest along a vector of the world."""
    x, y, z = rotated_back(poses, bodies.link[body], x, y, z)
    corners, found, least = bodies.corners, bodies.span[body, 0], math.inf
    for i in range(found, bodies.span[body, 1]):
        height = x * corners[i, 0] + y * corners[i, 1] + z * corners[i, 2]
        if height < least:
            found, least = i, height
    return found


@inlined
def corner_at(bodies: Bodies, body: int, corner: int, poses: Array) -> Vector:
    """Where a corner of a body is in the world [m]."""
    x, y, z = bodies.corners[corner, 0], bodies.corners[corner, 1], bodies.corners[corner, 2]
    return to_world(poses, bodies.link[body], x, y, z)


@inlined
def least_distance(bodies: Bodies, first: int, second: int, poses: Array) -> float:
    """Lower bound of two bodies' distance, by balls about them [m]."""
    a, b = bodies.balls[first], bodies.balls[second]
    x, y, z = to_world(poses, bodies.link[first], a[0], a[1], a[2])
    if bodies.flat[second]:
        normal = bodies.corners[bodies.span[second, 0]]
        height = x * normal[0] + y * normal[1] + z * normal[2]
        return height - bodies.rounding[second] - a[3]
    u, v, w = to_world(poses, bodies.link[second], b[0], b[1], b[2])
    x, y, z = x - u, y - v, z - w
    return math.sqrt(x * x + y * y + z * z) - a[3] - b[3]


@inlined
def above_plane(bodies: Bodies, first: int, second: int, poses: Array, points: Array) -> float:
    """Distance of a body from a half-space, and the closest points."""
    normal = bodies.corners[bodies.span[second, 0]]
    nx, ny, nz = normal[0], normal[1], normal[2]
    corner = lowest_in_world(bodies, first, poses, nx, ny, nz)
    x, y, z = corner_at(bodies, first, corner, poses)
    height = x * nx + y * ny + z * nz - bodies.rounding[second]
    radius = bodies.rounding[first]
    points[0, 0], points[0, 1], points[0, 2] = x - radius * nx, y - radius * ny, z - radius * nz
    points[1, 0], points[1, 1], points[1, 2] = x - height * nx, y - height * ny, z - height * nz
    return height - radius


@helper
def between(
    bodies: Bodies,
    first: int,
    second: int,
    poses: Array,
    simplex: Array,
    points: Array,
) -> float:
    """Distance of two bodies, and the closest points; minus infinity if polytopes overlap.

    ``simplex``, shape (4, 9), is work space for differences of corners, and those corners.
    """
    size, norm, x, y, z = 0, math.inf, 0.0, 0.0, 1.0
    # Walk towards the difference of two points that is closest to the origin.
    for _ in range(CORNERS_TRIED):
        low = lowest_in_world(bodies, first, poses, x, y, z)
        high = lowest_in_world(bodies, second, poses, -x, -y, -z)
        a, b = corner_at(bodies, first, low, poses), corner_at(bodies, second, high, poses)
        wx, wy, wz = a[0] - b[0], a[1] - b[1], a[2] - b[2]
        if norm - (x * wx + y * wy + z * wz) / norm <= PRECISION:
            break
        simplex[size, 0], simplex[size, 1], simplex[size, 2] = wx, wy, wz
        for k in range(3):
            simplex[size, 3 + k], simplex[size, 6 + k] = a[k], b[k]
        size, x, y, z = shrink(simplex, size + 1)
        shorter = math.sqrt(x * x + y * y + z * z)
        if shorter < OVERLAPPING:
            return -math.inf
        if shorter >= norm:
            break
        norm = shorter
    # The closest points combine their corners like the differences.
    weights = (1.0, 0.0, 0.0)
    if size == 2:
        here, there = of_segment(simplex, 0, 1)
        weights = (here, there, 0.0)
    elif size == 3:
        weights = of_triangle(simplex, 0, 1, 2)
    for k in range(3):
        points[0, k], points[1, k] = 0.0, 0.0
    for i in range(size):
        for k in range(3):
            points[0, k] += weights[i] * simplex[i, 3 + k]
            points[1, k] += weights[i] * simplex[i, 6 + k]
    # Shift them to the surfaces of the rounded bodies.
    inner, outer = bodies.rounding[first] / norm, bodies.rounding[second] / norm
    for k in range(3):
        normal = x if k == 0 else y if k == 1 else z
        points[0, k] -= inner * normal
        points[1, k] += outer * normal
    return norm - bodies.rounding[first] - bodies.rounding[second]


@kernel
def closest_pairs(
    first: int,
    last: int,
    chain: Chain,
    bodies: Bodies,
    configurations: Array,
    bounds: Array,
    nearest: NDArray[np.int64],
    points: Array,
) -> None:
    """Find the closest pair of some configurations.

    Parameters
    ----------
    first, last, chain, bodies
        Range of the rows, the arm, and its surroundings.
    configurations : ndarray, shape (n, n_joints)
        Joint positions [rad or m].
    bounds : ndarray, shape (n, n_pairs)
        Where lower bounds of distances go; that of the closest pair is its
        distance [m].
    nearest : ndarray of int, shape (n,)
        Where the closest pair goes; -1 if polytopes overlap or differ from the
        shapes.
    points : ndarray, shape (n, 2, 3)
        Where its two closest points go [m].
    """
    poses = np.zeros((configurations.shape[1] + 1, POSE))
    simplex, found = np.empty((4, 9)), np.empty((2, 3))
    n_pairs = bodies.pairs.shape[0]
    known = np.empty(n_pairs, dtype=np.bool_)
    for row in range(first, last):
        forward_kinematics(chain, configurations, row, poses)
        # Bound all distances from below, then measure the least ones.
        for pair in range(n_pairs):
            one, other = bodies.pairs[pair, 0], bodies.pairs[pair, 1]
            bounds[row, pair] = least_distance(bodies, one, other, poses)
            known[pair] = False
        shortest = math.inf
        while True:
            pair = 0
            for i in range(1, n_pairs):
                pair = i if bounds[row, i] < bounds[row, pair] else pair
            one, other = bodies.pairs[pair, 0], bodies.pairs[pair, 1]
            if known[pair]:
                break
            if bodies.flat[other]:
                distance = above_plane(bodies, one, other, poses, found)
            else:
                distance = between(bodies, one, other, poses, simplex, found)
            known[pair], bounds[row, pair] = True, distance
            if distance < shortest:
                shortest = distance
                for side in range(2):
                    for k in range(3):
                        points[row, side, k] = found[side, k]
        exact = bodies.exact[one] and bodies.exact[other] and shortest > -math.inf
        nearest[row] = pair if exact else -1
