"""Closest points of segments, and of a segment and a box, for a number or lanes."""

from kinarm.kernels.compiling import Vector, inlined
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
def turned_back(point: Vector, cosine: float, sine: float) -> Vector:
    """Coordinates of a point, or a direction, along axes that are turned about z."""
    return cosine * point[0] + sine * point[1], cosine * point[1] - sine * point[0], point[2]


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
