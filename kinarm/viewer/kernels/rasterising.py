"""Triangles to samples of a picture and to texels of a shadow.

Lengths are in metres, shapes of arrays in brackets.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.compiling import Array, Vector, inlined, kernel

NEAR = 0.01
"""Distance from the camera below which corners do not bound a triangle [m]."""


class Eye(NamedTuple):
    """From where a picture is seen.

    position (3,): place of the camera in the world.
    rays (3, 3): line of sight of the picture's upper left corner, per distance ahead, and what is
    added per column and per row.
    offsets (n_samples, 2): samples in a pixel, from its upper left corner.
    fog (2,): distances at which fading into the background begins and ends.
    """

    position: Array
    rays: Array
    offsets: Array
    fog: Array


class Surfaces(NamedTuple):
    """Triangles.

    places, normals (n_vertices, 3): in the world.
    corners (n_vertices, 3): column and row of each vertex in the picture, times the distance along
    the line of sight, and that distance.
    faces (n_faces, 3): vertices of each triangle.
    materials (n_vertices,): material of each vertex.
    """

    places: Array
    normals: Array
    corners: Array
    faces: NDArray[np.int64]
    materials: NDArray[np.int64]


@inlined
def edge(a: Vector, b: Vector) -> Vector:
    """Coefficients of x, y and 1 that are zero on a line through two corners."""
    ax, ay, aw = a
    bx, by, bw = b
    return ay * bw - by * aw, aw * bx - bw * ax, ax * by - bx * ay


@kernel
def transform(points: Array, frames: NDArray[np.int64], transforms: Array, result: Array) -> None:
    """Transform each point by its frame.

    Parameters
    ----------
    points, result : ndarray, shape (n, 3)
        Points, and where they go.
    frames : ndarray of int, shape (n,)
        Frame of each point.
    transforms : ndarray, shape (n_frames, 3, 4)
        Transforms of x, y, z and 1.
    """
    for i in range(points.shape[0]):
        frame = frames[i]
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for k in range(3):
            a, b, c = transforms[frame, k, 0], transforms[frame, k, 1], transforms[frame, k, 2]
            result[i, k] = a * x + b * y + c * z + transforms[frame, k, 3]


@kernel
def draw_view(
    corners: Array,
    faces: NDArray[np.int64],
    offsets: Array,
    nearness: NDArray[np.float32],
    index: NDArray[np.int32],
) -> None:
    """Find the nearest triangle at every sample, of those anticlockwise there.

    Barycentric coordinates over the distance are linear in the picture (Olano
    and Greer, 1997), so triangles behind the camera need no clipping.

    Parameters
    ----------
    corners, faces, offsets
        As in `Surfaces` and `Eye`.
    nearness, index : ndarray, shape (height, width, n_samples)
        ``nearness`` and ``seen`` of `View`; changed in place.
    """
    height, width, n_samples = index.shape
    for face in range(faces.shape[0]):
        i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
        xi, yi, wi = corners[i, 0], corners[i, 1], corners[i, 2]
        xj, yj, wj = corners[j, 0], corners[j, 1], corners[j, 2]
        xk, yk, wk = corners[k, 0], corners[k, 1], corners[k, 2]
        # Six times the volume between camera and triangle; positive ones face away.
        ai, bi, ci = edge((xj, yj, wj), (xk, yk, wk))
        volume = ai * xi + bi * yi + ci * wi
        if volume >= 0.0 or max(wi, wj, wk) < NEAR:
            continue
        # Pixels around the corners; all if one is behind the camera.
        left, right, top, bottom = 0, width - 1, 0, height - 1
        if min(wi, wj, wk) >= NEAR:
            ui, uj, uk, vi, vj, vk = xi / wi, xj / wj, xk / wk, yi / wi, yj / wj, yk / wk
            left = max(left, math.floor(max(min(ui, uj, uk), -1.0)))
            right = min(right, math.floor(min(max(ui, uj, uk), width + 0.0)))
            top = max(top, math.floor(max(min(vi, vj, vk), -1.0)))
            bottom = min(bottom, math.floor(min(max(vi, vj, vk), height + 0.0)))
        # Barycentric coordinates over the distance, by column and row.
        aj, bj, cj = edge((xk, yk, wk), (xi, yi, wi))
        ak, bk, ck = edge((xi, yi, wi), (xj, yj, wj))
        scale = 1.0 / volume
        ai, bi, ci = ai * scale, bi * scale, ci * scale
        aj, bj, cj = aj * scale, bj * scale, cj * scale
        ak, bk, ck = ak * scale, bk * scale, ck * scale
        # Samples within all edges, if nothing nearer is seen there.
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                for sample in range(n_samples):
                    x, y = column + offsets[sample, 0], row + offsets[sample, 1]
                    share_i = ai * x + bi * y + ci
                    share_j = aj * x + bj * y + cj
                    share_k = ak * x + bk * y + ck
                    if share_i >= 0.0 and share_j >= 0.0 and share_k >= 0.0:
                        near = share_i + share_j + share_k
                        if near > nearness[row, column, sample]:
                            nearness[row, column, sample] = near
                            index[row, column, sample] = face
