"""Distances of points from the hull of others."""

import math

import numpy as np

from kinarm.kernels.compiling import Array, kernel
from kinarm.kernels.simplex import shrink

ITERATIONS = 64
"""Corners that are tried for a point before its distance is taken as it is."""

PRECISION = 1e-9
"""By how much a distance may be too large [m]."""


@kernel
def distances_from_hull(corners: Array, points: Array, distances: Array) -> None:
    """Bound the distances of points, shape (n, 3), from the hull of corners from above [m].

    Each is that of a point of the hull, (nearly) the closest one.
    """
    simplex = np.empty((4, 3))
    for index in range(points.shape[0]):
        px, py, pz = points[index, 0], points[index, 1], points[index, 2]
        size = 1
        for axis in range(3):
            simplex[0, axis] = corners[0, axis] - points[index, axis]
        x, y, z = simplex[0, 0], simplex[0, 1], simplex[0, 2]
        for _ in range(ITERATIONS):
            square = x * x + y * y + z * z
            lowest, found = math.inf, 0
            for i in range(corners.shape[0]):
                height = (
                    x * (corners[i, 0] - px) + y * (corners[i, 1] - py) + z * (corners[i, 2] - pz)
                )
                if height < lowest:
                    lowest, found = height, i
            if square - lowest <= PRECISION * math.sqrt(square):
                break
            for axis in range(3):
                simplex[size, axis] = corners[found, axis] - points[index, axis]
            size, nx, ny, nz = shrink(simplex, size + 1)
            closer = nx * nx + ny * ny + nz * nz < square
            if closer:
                x, y, z = nx, ny, nz
            if size == 4 or not closer:
                break
        distances[index] = math.sqrt(x * x + y * y + z * z)
