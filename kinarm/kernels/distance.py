"""Lower bounds of distances, each certified by a separating plane."""

import math

import numpy as np
from numpy.typing import NDArray

from kinarm.collision import BETWEEN_CAPSULES, WITH_BOX, WITH_GROUND
from kinarm.kernels.compiling import Array, Vector, inlined
from kinarm.kernels.kinematics import to_world


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
    s = 0.0
    if determinant > 1e-12 * uu * vv:
        s = min(max((uv * vr - vv * ur) / determinant, 0.0), 1.0)
    t = 0.0
    if vv > 0.0:
        t = min(max((uv * s + vr) / vv, 0.0), 1.0)
    if uu > 0.0:
        s = min(max((uv * t - ur) / uu, 0.0), 1.0)
    return rx + s * ux - t * vx, ry + s * uy - t * vy, rz + s * uz - t * vz


@inlined
def segment_gap(a: Vector, b: Vector, c: Vector, d: Vector) -> float:
    """Lower bound of the distance between the segments ab and cd, certified by a plane.

    The vector between (nearly) closest points only proposes the plane; the bound is the gap
    between the two segments along it, and so holds however the vector was found.
    """
    nx, ny, nz = between_segments(a, b, c, d)
    norm = math.sqrt(nx * nx + ny * ny + nz * nz)
    if norm < 1e-12:
        return 0.0
    along_u = nx * (b[0] - a[0]) + ny * (b[1] - a[1]) + nz * (b[2] - a[2])
    along_v = nx * (d[0] - c[0]) + ny * (d[1] - c[1]) + nz * (d[2] - c[2])
    along_r = nx * (a[0] - c[0]) + ny * (a[1] - c[1]) + nz * (a[2] - c[2])
    return (along_r + min(along_u, 0.0) - max(along_v, 0.0)) / norm


@inlined
def closest_to_box(a: Vector, b: Vector, lower: Vector, upper: Vector) -> float:
    """Where on the segment ab, from 0 to 1, it is (nearly) closest to a box.

    By a safeguarded Newton iteration on the squared distance, which is convex along the segment.
    """
    lx, ly, lz = lower
    hx, hy, hz = upper
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    low, high, t = 0.0, 1.0, 0.5
    for _ in range(16):
        x, y, z = a[0] + t * ux, a[1] + t * uy, a[2] + t * uz
        nx = x - min(max(x, lx), hx)
        ny = y - min(max(y, ly), hy)
        nz = z - min(max(z, lz), hz)
        slope = nx * ux + ny * uy + nz * uz
        curvature = 0.0
        if nx != 0.0:
            curvature += ux * ux
        if ny != 0.0:
            curvature += uy * uy
        if nz != 0.0:
            curvature += uz * uz
        if slope == 0.0 or (slope > 0.0 and t == 0.0) or (slope < 0.0 and t == 1.0):
            break
        if slope > 0.0:
            high = t
        else:
            low = t
        step = t - slope / curvature
        if abs(step - t) < 1e-12:
            break
        if step <= low:
            step = 0.0 if low == 0.0 else 0.5 * (low + high)
        elif step >= high:
            step = 1.0 if high == 1.0 else 0.5 * (low + high)
        t = step
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
    if norm < 1e-12:
        return 0.0
    first = nx * a[0] + ny * a[1] + nz * a[2]
    second = nx * b[0] + ny * b[1] + nz * b[2]
    support = (
        max(nx * lower[0], nx * upper[0])
        + max(ny * lower[1], ny * upper[1])
        + max(nz * lower[2], nz * upper[2])
    )
    return (min(first, second) - support) / norm


@inlined
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
    c = d = (0.0, 0.0, 0.0)
    if kind == WITH_BOX:
        c = (boxes[j, 0, 0], boxes[j, 0, 1], boxes[j, 0, 2])
        d = (boxes[j, 1, 0], boxes[j, 1, 1], boxes[j, 1, 2])
    elif kind == BETWEEN_CAPSULES:
        radius += capsules[j, 6]
        c = to_world(poses, link[j], capsules[j, 0], capsules[j, 1], capsules[j, 2])
        d = to_world(poses, link[j], capsules[j, 3], capsules[j, 4], capsules[j, 5])
    if kind == WITH_GROUND:
        gap = min(a[2], b[2])
    elif kind == WITH_BOX:
        gap = box_gap(a, b, c, d)
    else:
        gap = segment_gap(a, b, c, d)
    return float(gap - radius)
