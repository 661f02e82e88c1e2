"""Closest points of segments, boxes, simplices and hulls.

Segments and boxes are of numbers or lanes. In simplices of up to four corners, the point closest to
the origin is found (Ericson, Real-Time Collision Detection).
"""

import math

import numpy as np

from kinarm.kernels.compiling import Array, Vector, helper, inlined, kernel
from kinarm.kernels.lanes import any_lane, select


@inlined
def between_segments(a: Vector, b: Vector, c: Vector, d: Vector) -> Vector:
    """Vector from segment cd to ab, between (nearly) closest points."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = d[0] - c[0], d[1] - c[1], d[2] - c[2]
    rx, ry, rz = a[0] - c[0], a[1] - c[1], a[2] - c[2]
    uu = ux * ux + uy * uy + uz * uz
    vv = vx * vx + vy * vy + vz * vz
    uv = ux * vx + uy * vy + uz * vz
    ur = ux * rx + uy * ry + uz * rz
    vr = vx * rx + vy * ry + vz * rz
    determinant = uu * vv - uv * uv
    crossing = determinant > 1e-12 * uu * vv
    s = select(crossing, min(max((uv * vr - vv * ur) / determinant, 0.0), 1.0), 0.0)
    t = select(vv > 0.0, min(max((uv * s + vr) / vv, 0.0), 1.0), 0.0)
    s = select(uu > 0.0, min(max((uv * t - ur) / uu, 0.0), 1.0), s)
    return rx + s * ux - t * vx, ry + s * uy - t * vy, rz + s * uz - t * vz


@inlined
def closest_to_box(a: Vector, b: Vector, lower: Vector, upper: Vector) -> float:
    """Where on the segment ab, from 0 to 1, it is (nearly) closest to a box.

    A safeguarded Newton iteration on the squared distance, which is convex along it.
    """
    lx, ly, lz = lower
    hx, hy, hz = upper
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    t = 0.0 * ux + 0.5
    low, high = 0.0 * t, 0.0 * t + 1.0
    for _ in range(16):
        x, y, z = a[0] + t * ux, a[1] + t * uy, a[2] + t * uz
        nx = x - min(max(x, lx), hx)
        ny = y - min(max(y, ly), hy)
        nz = z - min(max(z, lz), hz)
        slope = nx * ux + ny * uy + nz * uz
        curvature = (
            select(nx != 0.0, ux * ux, 0.0)
            + select(ny != 0.0, uy * uy, 0.0)
            + select(nz != 0.0, uz * uz, 0.0)
        )
        goes_on = (slope > 0.0) & (t > 0.0) | (slope < 0.0) & (t < 1.0)
        high, low = select(slope > 0.0, t, high), select(slope > 0.0, low, t)
        step = t - slope / curvature
        goes_on = goes_on & (abs(step - t) >= 1e-12)
        if not any_lane(goes_on):
            break
        middle = 0.5 * (low + high)
        step = select(step <= low, select(low == 0.0, 0.0, middle), step)
        step = select(step >= high, select(high == 1.0, 1.0, middle), step)
        t = select(goes_on, step, t)
    return t


@inlined
def scalar_product(simplex: Array, i: int, a: Vector) -> float:
    """Scalar product of a corner and a vector."""
    return simplex[i, 0] * a[0] + simplex[i, 1] * a[1] + simplex[i, 2] * a[2]


@inlined
def edge(simplex: Array, i: int, j: int) -> Vector:
    """Vector from one corner to another."""
    return (
        simplex[j, 0] - simplex[i, 0],
        simplex[j, 1] - simplex[i, 1],
        simplex[j, 2] - simplex[i, 2],
    )


@inlined
def of_segment(simplex: Array, i: int, j: int) -> tuple[float, float]:
    """Weights of two corners in the closest point of their segment."""
    along = edge(simplex, i, j)
    length = along[0] * along[0] + along[1] * along[1] + along[2] * along[2]
    share = 0.0
    if length > 0.0:
        share = min(max(-scalar_product(simplex, i, along) / length, 0.0), 1.0)
    return 1.0 - share, share


@helper
def of_triangle(simplex: Array, i: int, j: int, k: int) -> Vector:
    """Weights of three corners in the closest point of their triangle."""
    ab, ac = edge(simplex, i, j), edge(simplex, i, k)
    d1, d2 = -scalar_product(simplex, i, ab), -scalar_product(simplex, i, ac)
    if d1 <= 0.0 and d2 <= 0.0:
        return 1.0, 0.0, 0.0
    d3, d4 = -scalar_product(simplex, j, ab), -scalar_product(simplex, j, ac)
    if d3 >= 0.0 and d4 <= d3:
        return 0.0, 1.0, 0.0
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        share = d1 / (d1 - d3)
        return 1.0 - share, share, 0.0
    d5, d6 = -scalar_product(simplex, k, ab), -scalar_product(simplex, k, ac)
    if d6 >= 0.0 and d5 <= d6:
        return 0.0, 0.0, 1.0
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        share = d2 / (d2 - d6)
        return 1.0 - share, 0.0, share
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 >= d3 and d5 >= d6:
        share = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 0.0, 1.0 - share, share
    whole = va + vb + vc
    return va / whole, vb / whole, vc / whole


@inlined
def normal_of(simplex: Array, i: int, j: int, k: int) -> Vector:
    """Normal of a triangle of corners, of any length."""
    ab, ac = edge(simplex, i, j), edge(simplex, i, k)
    return (
        ab[1] * ac[2] - ab[2] * ac[1],
        ab[2] * ac[0] - ab[0] * ac[2],
        ab[0] * ac[1] - ab[1] * ac[0],
    )


@inlined
def is_beyond(simplex: Array, i: int, j: int, k: int, other: int) -> bool:
    """Whether a triangle separates the origin from the fourth corner."""
    normal = normal_of(simplex, i, j, k)
    here = scalar_product(simplex, i, normal)
    return bool(here * (scalar_product(simplex, other, normal) - here) >= 0.0)


@helper
def depth_in(simplex: Array) -> float:
    """How deep the origin is in a tetrahedron at least; not positive if outside."""
    least = math.inf
    for face in range(4):
        i, j, k = (1 if face < 1 else 0), (2 if face < 2 else 1), (3 if face < 3 else 2)
        x, y, z = normal_of(simplex, i, j, k)
        norm = math.sqrt(x * x + y * y + z * z)
        if norm == 0.0:
            return 0.0
        here = scalar_product(simplex, i, (x, y, z)) / norm
        height = scalar_product(simplex, face, (x, y, z)) / norm - here
        # No ball about the origin is larger than the height of a corner.
        least = min(least, min(abs(height), -here if height > 0.0 else here))
    return least


@helper
def shrink(simplex: Array, size: int) -> tuple[int, float, float, float]:
    """Drop corners not needed for the closest point; return their number, and it.

    The rest of a corner's row stays with it. A tetrahedron around the origin stays as it is.
    """
    a, b, c, d = 1.0, 0.0, 0.0, 0.0
    if size == 2:
        a, b = of_segment(simplex, 0, 1)
    elif size == 3:
        a, b, c = of_triangle(simplex, 0, 1, 2)
    elif size == 4:
        least = -1.0
        for face in range(4):
            i, j, k = (1 if face < 1 else 0), (2 if face < 2 else 1), (3 if face < 3 else 2)
            if not is_beyond(simplex, i, j, k, face):
                continue
            u, v, w = of_triangle(simplex, i, j, k)
            square = 0.0
            for axis in range(3):
                x = u * simplex[i, axis] + v * simplex[j, axis] + w * simplex[k, axis]
                square += x * x
            if least < 0.0 or square < least:
                least = square
                a = 0.0 if face == 0 else u
                b = 0.0 if face == 1 else (u if face < 1 else v)
                c = 0.0 if face == 2 else (v if face < 2 else w)
                d = 0.0 if face == 3 else w
        if least < 0.0:
            return 4, 0.0, 0.0, 0.0
    kept, x, y, z = 0, 0.0, 0.0, 0.0
    for corner in range(size):
        weight = a if corner == 0 else b if corner == 1 else c if corner == 2 else d
        if weight > 0.0:
            x += weight * simplex[corner, 0]
            y += weight * simplex[corner, 1]
            z += weight * simplex[corner, 2]
            for column in range(simplex.shape[1]):
                simplex[kept, column] = simplex[corner, column]
            kept += 1
    return kept, x, y, z


ITERATIONS = 64
"""Corners that are tried for a point."""

PRECISION = 1e-9
"""Largest excess of a distance [m]."""


@kernel
def distances_from_hull(corners: Array, points: Array, distances: Array) -> None:
    """Bound distances of points from the hull of corners, by (nearly) closest points.

    Parameters
    ----------
    corners, points : ndarray, shape (n_corners, 3) and (n, 3)
        Corners of the hull, and points [m].
    distances : ndarray, shape (n,)
        Where the bounds go [m].
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
