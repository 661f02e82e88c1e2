"""Separating planes between two bodies, for a number or lanes.

A rounded polytope, the hull of a few corners widened by a radius, encloses each
body. A pair's plane lies above its first body, the carrier, and moves with it;
the least height of the second, the mover, above it bounds their distance from
below. A half-space's plane is its surface.

A plane has five entries: unit normal x, y, z in the frame that carries it (the
world's for bodies of the scene that rest), offset along the normal, and the
mover's least height when last asked for [m].

The best plane follows from the distance algorithm of Gilbert, Johnson and Keerthi. In the carrier's
frame it looks for the point closest to the origin of all differences of points of mover and
carrier, in a simplex of at most four differences of corners, renewed by the lowest ones.
"""

import math

from kinarm.contact_shapes import BETWEEN_CAPSULES, WITH_HALFSPACE, ContactShapes
from kinarm.kernels.compiling import Array, Vector, helper, inlined
from kinarm.kernels.distance import between_segments, depth_in, shrink
from kinarm.kernels.kinematics import rotated, rotated_back, to_frame, to_world
from kinarm.kernels.lanes import as_lanes, is_number, least_lane, select

EVERYDAY, FINE = 0, 1
"""Levels of `ContactShapes.proxies`."""

OFFSET, GAP = 3, 4
"""Entries of a plane after its normal."""

ALTERNATIONS = 3
"""Projections between box and segment for a first plane."""

DEPTH = 1e-6
"""Depth beyond which contact is claimed [m]."""

CORNERS_TRIED = 24
"""Corners at which the search ends."""

CLOSE = 1e-7
"""Precision of the distance [m]."""

LEVEL = 0.02
"""Rise of an axis above a half-space below which no end of it is the nearest [m]."""

COARSE = 0.02
"""Precision of the distance of far bodies, as a share of it."""


@inlined
def is_placed(shapes: ContactShapes, frame: int, poses: Array) -> bool:
    """Whether a frame is that of a body of the scene, whose row has a size."""
    return frame >= poses.shape[0] - shapes.placed.shape[0]


@inlined
def in_world(shapes: ContactShapes, pair: int) -> bool:
    """Whether the world carries a pair's plane."""
    return shapes.planes[pair, 4] == 0


@inlined
def axis_in_world(shapes: ContactShapes, body: int, poses: Array) -> tuple[Vector, Vector]:
    """End points of the axis of a body's capsule in the world [m]."""
    link, axis = shapes.bodies[body, 2], shapes.capsules[body]
    if is_placed(shapes, link, poses):
        half = poses[link, 2]
        return to_world(poses, link, 0.0, 0.0, -half), to_world(poses, link, 0.0, 0.0, half)
    start = to_world(poses, link, axis[0], axis[1], axis[2])
    return start, to_world(poses, link, axis[3], axis[4], axis[5])


@inlined
def surface(poses: Array, frame: int) -> tuple[float, float, float, float]:
    """Outer normal of the half-space of a frame, in the world, and offset along it [m]."""
    x, y, z = poses[frame, 6], poses[frame, 9], poses[frame, 12]
    return x, y, z, x * poses[frame, 13] + y * poses[frame, 14] + z * poses[frame, 15]


@inlined
def box_about(shapes: ContactShapes, body: int, poses: Array) -> tuple[Vector, Vector]:
    """Lower and upper ends of the corners of a body of the scene, in its frame [m]."""
    frame = shapes.bodies[body, 2]
    sx, sy, sz = poses[frame, 0], poses[frame, 1], poses[frame, 2]
    low, high = shapes.extents[body, 0], shapes.extents[body, 1]
    return (sx * low[0], sy * low[1], sz * low[2]), (sx * high[0], sy * high[1], sz * high[2])


@inlined
def lowest(shapes: ContactShapes, body: int, x: float, y: float, z: float) -> float:
    """Least coordinate of a body's corners along a vector of its joint frame."""
    if is_number(x):
        # A block of corners at once.
        blocks, row = as_lanes(shapes.blocks), shapes.bodies[body]
        first, last = row[3], row[4]
        lows = x * blocks[first, 0] + y * blocks[first, 1] + z * blocks[first, 2]
        for i in range(first + 1, last):
            lows = min(lows, x * blocks[i, 0] + y * blocks[i, 1] + z * blocks[i, 2])
        return least_lane(lows)
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

    The level, `EVERYDAY` or `FINE`, is that of the mover's polytope.
    """
    base, mover = shapes.planes[pair, 4], shapes.proxies[pair, level, 1]
    link = shapes.bodies[mover, 2]
    x, y, z = rotated(poses, base, plane[row, 0], plane[row, 1], plane[row, 2])
    along = (
        x * (poses[link, 13] - poses[base, 13])
        + y * (poses[link, 14] - poses[base, 14])
        + z * (poses[link, 15] - poses[base, 15])
    )
    x, y, z = rotated_back(poses, link, x, y, z)
    return along + lowest(shapes, mover, x, y, z) - plane[row, OFFSET] - shapes.rounding[mover]


@inlined
def radius_of(shapes: ContactShapes, body: int, poses: Array) -> float:
    """Radius of a body's capsule [m]; minus infinity if nothing in the body is known."""
    frame = shapes.bodies[body, 2]
    radius = 0.0 * poses[0, 13] + shapes.capsules[body, 6]
    if is_placed(shapes, frame, poses):
        radius += poses[frame, 3]
    return radius


@helper
def approach(shapes: ContactShapes, pair: int, poses: Array) -> tuple[float, Vector]:
    """Lower bound of a pair's overlap, negative if apart [m], and a likely normal of its plane.

    What lies in the bodies overlaps if two points of it are closer than the radii about them. The
    normal, of any length and in the carrier's frame, leads from there to the mover's axis: from
    the carrier's axis, the box about it, or its surface.
    """
    kind, carrier, mover = shapes.pairs[pair, 0], shapes.planes[pair, 0], shapes.planes[pair, 1]
    frame = shapes.bodies[carrier, 2]
    radius = radius_of(shapes, mover, poses) + radius_of(shapes, carrier, poses)
    a, b = axis_in_world(shapes, mover, poses)
    if kind == WITH_HALFSPACE:
        x, y, z, offset = surface(poses, frame)
        start, end = x * a[0] + y * a[1] + z * a[2], x * b[0] + y * b[1] + z * b[2]
        return radius - (min(start, end) - offset), (0.0 * x, 0.0 * x, 0.0 * x + 1.0)
    if kind == BETWEEN_CAPSULES:
        c, d = axis_in_world(shapes, carrier, poses)
        x, y, z = between_segments(a, b, c, d)
        x, y, z = rotated_back(poses, frame, x, y, z)
    else:
        a, b = to_frame(poses, frame, a), to_frame(poses, frame, b)
        (x, y, z), _ = from_box(a, b, *box_about(shapes, carrier, poses))
    return radius - math.sqrt(x * x + y * y + z * z), (x, y, z)


@helper
def propose(shapes: ContactShapes, pair: int, poses: Array, plane: Array, row: int) -> None:
    """Fill in a row of the planes with a likely plane for a pair, without its height."""
    lay_plane(shapes, pair, poses, approach(shapes, pair, poses)[1], plane, row)


@helper
def lay_plane(
    shapes: ContactShapes, pair: int, poses: Array, along: Vector, plane: Array, row: int
) -> None:
    """Fill in a row of the planes: above a pair's carrier, with a normal in its frame."""
    (x, y, z), frame = along, shapes.bodies[shapes.planes[pair, 0], 2]
    norm = math.sqrt(x * x + y * y + z * z)
    inside = norm < 1e-9
    x, y, z = x / norm, y / norm, z / norm
    x, y, z = select(inside, 0.0, x), select(inside, 0.0, y), select(inside, 1.0, z)
    proxy = shapes.proxies[pair, EVERYDAY, 0]
    if is_placed(shapes, frame, poses):
        sx, sy, sz = poses[frame, 0], poses[frame, 1], poses[frame, 2]
        above = poses[frame, 3] - lowest(shapes, proxy, -sx * x, -sy * y, -sz * z)
        if in_world(shapes, pair):
            x, y, z = rotated(poses, frame, x, y, z)
            above += x * poses[frame, 13] + y * poses[frame, 14] + z * poses[frame, 15]
    else:
        above = shapes.rounding[proxy] - lowest(shapes, proxy, -x, -y, -z)
    plane[row, 0], plane[row, 1], plane[row, 2], plane[row, OFFSET] = x, y, z, above


@inlined
def foot(shapes: ContactShapes, pair: int, poses: Array) -> Vector:
    """Point of a mover's axis that is close to a body of the scene, in the world [m].

    It moves as they do, without jumps.
    """
    carrier, mover = shapes.planes[pair, 0], shapes.planes[pair, 1]
    frame = shapes.bodies[carrier, 2]
    a, b = axis_in_world(shapes, mover, poses)
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    if shapes.pairs[pair, 0] == WITH_HALFSPACE:
        x, y, z, _ = surface(poses, frame)
        share = min(max(0.5 - (x * ux + y * uy + z * uz) / (2.0 * LEVEL), 0.0), 1.0)
    else:
        box = box_about(shapes, carrier, poses)
        share = from_box(to_frame(poses, frame, a), to_frame(poses, frame, b), *box)[1]
    return a[0] + share * ux, a[1] + share * uy, a[2] + share * uz


@inlined
def from_box(a: Vector, b: Vector, lower: Vector, upper: Vector) -> tuple[Vector, float]:
    """Vector from a box to the segment ab, close to the shortest one, and where it ends there."""
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
    return (x - cx, y - cy, z - cz), t


@inlined
def lowest_corner(shapes: ContactShapes, body: int, x: float, y: float, z: float) -> int:
    """Row of a body's corner that is lowest along a vector of its joint frame."""
    blocks, first, last = as_lanes(shapes.blocks), shapes.bodies[body, 3], shapes.bodies[body, 4]
    least = x * blocks[first, 0] + y * blocks[first, 1] + z * blocks[first, 2]
    found = blocks[first, 3]
    for i in range(first + 1, last):
        height = x * blocks[i, 0] + y * blocks[i, 1] + z * blocks[i, 2]
        found = select(height < least, blocks[i, 3], found)
        least = min(height, least)
    return int(least_lane(select(least <= least_lane(least), found, shapes.bodies[body, 1] - 1.0)))


@helper
def separate(
    shapes: ContactShapes,
    pair: int,
    poses: Array,
    relative: Array,
    simplex: Array,
    plane: Array,
    enough: float = math.inf,
) -> tuple[float, bool]:
    """Find a plane that separates a pair well, or by more than is ``enough`` [m].

    Returns the mover's height above it [m], and whether they surely touch. Takes poses of numbers.
    The plane, shape (1, PLANE), is replaced by a better one.
    ``relative``, shape (1, POSE), and ``simplex``, shape (4, 3), are work space.
    """
    carrier, mover = shapes.proxies[pair, FINE, 0], shapes.proxies[pair, FINE, 1]
    base, link = shapes.bodies[carrier, 2], shapes.bodies[mover, 2]
    # The mover's pose in the carrier's frame.
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
    corners, widened, sx, sy, sz = shapes.corners, shapes.rounding[carrier], 1.0, 1.0, 1.0
    nx, ny, nz = plane[0, 0], plane[0, 1], plane[0, 2]
    placed = is_placed(shapes, base, poses)
    turned = placed and in_world(shapes, pair)
    if placed:
        sx, sy, sz, widened = poses[base, 0], poses[base, 1], poses[base, 2], poses[base, 3]
    if turned:
        nx, ny, nz = rotated_back(poses, base, nx, ny, nz)
    rounding = widened + shapes.rounding[mover]
    inner = rounding - shapes.excess[carrier] - shapes.excess[mover] - DEPTH
    best, size, norm = -math.inf, 0, math.inf
    for _ in range(CORNERS_TRIED):
        # The mover's lowest corner, and the carrier's highest.
        x, y, z = rotated_back(relative, 0, nx, ny, nz)
        low = lowest_corner(shapes, mover, x, y, z)
        high = lowest_corner(shapes, carrier, -sx * nx, -sy * ny, -sz * nz)
        hx, hy, hz = sx * corners[high, 0], sy * corners[high, 1], sz * corners[high, 2]
        x, y, z = corners[low, 0], corners[low, 1], corners[low, 2]
        wx = relative[0, 13] + relative[0, 4] * x + relative[0, 5] * y + relative[0, 6] * z
        wy = relative[0, 14] + relative[0, 7] * x + relative[0, 8] * y + relative[0, 9] * z
        wz = relative[0, 15] + relative[0, 10] * x + relative[0, 11] * y + relative[0, 12] * z
        above = nx * hx + ny * hy + nz * hz
        gap = nx * wx + ny * wy + nz * wz - above
        wx, wy, wz = wx - hx, wy - hy, wz - hz
        if gap > best:
            best = gap
            plane[0, 0], plane[0, 1], plane[0, 2] = nx, ny, nz
            plane[0, OFFSET] = above + widened
        missing = norm - max(best, 0.0)
        if best - rounding > enough:
            break
        if missing <= CLOSE or missing <= COARSE * (best - rounding) or norm <= inner:
            break
        simplex[size, 0], simplex[size, 1], simplex[size, 2] = wx, wy, wz
        size, x, y, z = shrink(simplex, size + 1)
        norm = math.sqrt(x * x + y * y + z * z)
        if norm < CLOSE:
            break
        nx, ny, nz = x / norm, y / norm, z / norm
    if turned:
        x, y, z = rotated(poses, base, plane[0, 0], plane[0, 1], plane[0, 2])
        plane[0, OFFSET] += x * poses[base, 13] + y * poses[base, 14] + z * poses[base, 15]
        plane[0, 0], plane[0, 1], plane[0, 2] = x, y, z
    plane[0, GAP] = best - rounding
    if norm < CLOSE and size == 4:
        norm = -depth_in(simplex)
    return best - rounding, norm <= inner
