"""Separating planes between two bodies, for a number or lanes.

A body is enclosed by a rounded polytope: the hull of a few corners, widened by a radius. A pair of
bodies keeps a plane that moves with the first of them, the carrier, which lies below it; the least
height of the second, the mover, above the plane is a lower bound of their distance. Of the ground,
the plane is its surface.

A plane has five entries: unit normal x, y, z in the joint frame that carries it, offset along
the normal, and the least height of the mover above it, when that was last asked for [m].
"""

import math

from kinarm.contact_shapes import GROUND, ContactShapes
from kinarm.kernels.compiling import Array, Vector, helper, inlined
from kinarm.kernels.distance import between_segments
from kinarm.kernels.kinematics import rotated, rotated_back, to_world
from kinarm.kernels.lanes import select

EVERYDAY, FINE = 0, 1
"""Levels of `ContactShapes.proxies`."""

OFFSET, GAP = 3, 4
"""Entries of a plane after its normal."""

ALTERNATIONS = 3
"""Projections between box and segment by which a first plane is proposed."""


@inlined
def axis_in_world(shapes: ContactShapes, body: int, poses: Array) -> tuple[Vector, Vector]:
    """End points of the axis of a body's capsule in the world [m]."""
    link, axis = shapes.bodies[body, 2], shapes.capsules[body]
    start = to_world(poses, link, axis[0], axis[1], axis[2])
    return start, to_world(poses, link, axis[3], axis[4], axis[5])


@inlined
def lowest(shapes: ContactShapes, body: int, x: float, y: float, z: float) -> float:
    """Smallest coordinate of a body along a vector of its joint frame, its radius apart."""
    corners, first, last = shapes.corners, shapes.bodies[body, 0], shapes.bodies[body, 1]
    least = x * corners[first, 0] + y * corners[first, 1] + z * corners[first, 2]
    for i in range(first + 1, last):
        least = min(least, x * corners[i, 0] + y * corners[i, 1] + z * corners[i, 2])
    return least


@inlined
def height_above(
    shapes: ContactShapes, pair: int, level: int, poses: Array, plane: Array, row: int
) -> float:
    """Least height of a pair's mover above a row of the planes [m].

    The level is `EVERYDAY` or `FINE`: which polytope stands for the mover.
    """
    carrier, mover = shapes.planes[pair, 0], shapes.proxies[pair, level, 1]
    base = 0 if carrier == GROUND else shapes.bodies[carrier, 2]
    link = shapes.bodies[mover, 2]
    x, y, z = rotated(poses, base, plane[row, 0], plane[row, 1], plane[row, 2])
    along = (
        x * (poses[link, 13] - poses[base, 13])
        + y * (poses[link, 14] - poses[base, 14])
        + z * (poses[link, 15] - poses[base, 15])
    )
    x, y, z = rotated_back(poses, link, x, y, z)
    return along + lowest(shapes, mover, x, y, z) - plane[row, OFFSET] - shapes.rounding[mover]


@helper
def propose(shapes: ContactShapes, pair: int, poses: Array, plane: Array, row: int) -> None:
    """Fill in a row of the planes with a likely plane for a pair; its height is left as it is.

    Its normal leads from the carrier's axis, or the box about an obstacle, to the mover's axis.
    Whether such a plane separates the two is for its height to tell.
    """
    carrier, mover = shapes.planes[pair, 0], shapes.planes[pair, 1]
    if carrier == GROUND:
        plane[row, 0], plane[row, 1], plane[row, 2], plane[row, OFFSET] = 0.0, 0.0, 1.0, 0.0
        return
    a, b = axis_in_world(shapes, mover, poses)
    if carrier < shapes.capsules.shape[0]:
        c, d = axis_in_world(shapes, carrier, poses)
        x, y, z = between_segments(a, b, c, d)
        x, y, z = rotated_back(poses, shapes.bodies[carrier, 2], x, y, z)
    else:
        lower, upper = shapes.extents[carrier, 0], shapes.extents[carrier, 1]
        x, y, z = from_box(a, b, (lower[0], lower[1], lower[2]), (upper[0], upper[1], upper[2]))
    norm = math.sqrt(x * x + y * y + z * z)
    inside = norm < 1e-9
    x, y, z = x / norm, y / norm, z / norm
    x, y, z = select(inside, 0.0, x), select(inside, 0.0, y), select(inside, 1.0, z)
    plane[row, 0], plane[row, 1], plane[row, 2] = x, y, z
    proxy = shapes.proxies[pair, EVERYDAY, 0]
    plane[row, OFFSET] = shapes.rounding[proxy] - lowest(shapes, proxy, -x, -y, -z)


@inlined
def from_box(a: Vector, b: Vector, lower: Vector, upper: Vector) -> Vector:
    """Vector from a point of a box to one of the segment ab, close to the shortest one."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    length = ux * ux + uy * uy + uz * uz + 1e-12
    x, y, z = a[0] + 0.5 * ux, a[1] + 0.5 * uy, a[2] + 0.5 * uz
    for _ in range(ALTERNATIONS):
        cx = min(max(x, lower[0]), upper[0])
        cy = min(max(y, lower[1]), upper[1])
        cz = min(max(z, lower[2]), upper[2])
        t = ((cx - a[0]) * ux + (cy - a[1]) * uy + (cz - a[2]) * uz) / length
        t = min(max(t, 0.0), 1.0)
        x, y, z = a[0] + t * ux, a[1] + t * uy, a[2] + t * uz
    return x - cx, y - cy, z - cz
