"""Lower bounds of distances, each certified by a separating plane."""

import math

import numpy as np
from numpy.typing import NDArray

from kinarm.collision import WITH_BOX, WITH_GROUND
from kinarm.kernels.compiling import Array, Vector, helper, inlined
from kinarm.kernels.kinematics import to_world
from kinarm.kernels.lanes import any_lane, select


@inlined
def between_segments(a: Vector, b: Vector, c: Vector, d: Vector) -> Vector:
    """Vector from a point of the segment cd to one of ab, (nearly) the closest ones."""
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
def segment_gap(a: Vector, b: Vector, c: Vector, d: Vector) -> float:
    """Lower bound of the distance between the segments ab and cd, certified by a plane.

    The vector between (nearly) closest points only proposes the plane; the bound is the gap
    between the two segments along it, and so holds however the vector was found.
    """
    nx, ny, nz = between_segments(a, b, c, d)
    norm = math.sqrt(nx * nx + ny * ny + nz * nz)
    along_u = nx * (b[0] - a[0]) + ny * (b[1] - a[1]) + nz * (b[2] - a[2])
    along_v = nx * (d[0] - c[0]) + ny * (d[1] - c[1]) + nz * (d[2] - c[2])
    along_r = nx * (a[0] - c[0]) + ny * (a[1] - c[1]) + nz * (a[2] - c[2])
    gap = (along_r + min(along_u, 0.0) - max(along_v, 0.0)) / norm
    return select(norm < 1e-12, 0.0, gap)


@inlined
def closest_to_box(a: Vector, b: Vector, lower: Vector, upper: Vector) -> float:
    """Where on the segment ab, from 0 to 1, it is (nearly) closest to a box.

    By a safeguarded Newton iteration on the squared distance, which is convex along the segment.
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
def box_gap(a: Vector, b: Vector, lower: Vector, upper: Vector) -> float:
    """Lower bound of the distance between the segment ab and a box, certified by a plane.

    The vector between (nearly) closest points proposes the plane.
    """
    t = closest_to_box(a, b, lower, upper)
    x, y, z = a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])
    nx = x - min(max(x, lower[0]), upper[0])
    ny = y - min(max(y, lower[1]), upper[1])
    nz = z - min(max(z, lower[2]), upper[2])
    norm = math.sqrt(nx * nx + ny * ny + nz * nz)
    first = nx * a[0] + ny * a[1] + nz * a[2]
    second = nx * b[0] + ny * b[1] + nz * b[2]
    support = (
        max(nx * lower[0], nx * upper[0])
        + max(ny * lower[1], ny * upper[1])
        + max(nz * lower[2], nz * upper[2])
    )
    return select(norm < 1e-12, 0.0, (min(first, second) - support) / norm)


@helper
def clearance(
    pair: int,
    pairs: NDArray[np.int64],
    capsules: Array,
    link: NDArray[np.int64],
    boxes: Array,
    poses: Array,
) -> float:
    """Lower bound of the distance between the two bodies of a pair [m]."""
    kind, i, j = pairs[pair, 0], pairs[pair, 1], pairs[pair, 2]
    radius = capsules[i, 6]
    a = to_world(poses, link[i], capsules[i, 0], capsules[i, 1], capsules[i, 2])
    b = to_world(poses, link[i], capsules[i, 3], capsules[i, 4], capsules[i, 5])
    if kind == WITH_GROUND:
        return min(a[2], b[2]) - radius
    if kind == WITH_BOX:
        lower = (boxes[j, 0, 0], boxes[j, 0, 1], boxes[j, 0, 2])
        upper = (boxes[j, 1, 0], boxes[j, 1, 1], boxes[j, 1, 2])
        return box_gap(a, b, lower, upper) - radius
    c = to_world(poses, link[j], capsules[j, 0], capsules[j, 1], capsules[j, 2])
    d = to_world(poses, link[j], capsules[j, 3], capsules[j, 4], capsules[j, 5])
    return segment_gap(a, b, c, d) - (radius + capsules[j, 6])
