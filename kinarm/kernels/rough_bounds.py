"""Rough lower bounds of distances and heights, by capsules around shapes of the arm, and balls."""

import math

from kinarm.contact_shapes import WITH_HALFSPACE, ContactShapes
from kinarm.kernels.compiling import Array, Vector, inlined
from kinarm.kernels.kinematics import rotated, to_frame, to_world
from kinarm.kernels.planes import OFFSET, box_about, is_placed, surface


@inlined
def off_box(shapes: ContactShapes, body: int, point: Vector, poses: Array) -> Vector:
    """Shortest vector from the box about a body of the scene to a point, in the body's frame."""
    x, y, z = to_frame(poses, shapes.bodies[body, 2], point)
    lower, upper = box_about(shapes, body, poses)
    x -= min(max(x, lower[0]), upper[0])
    y -= min(max(y, lower[1]), upper[1])
    z -= min(max(z, lower[2]), upper[2])
    return x, y, z


@inlined
def has_corners(shapes: ContactShapes, body: int) -> bool:
    """Whether a body is more than its capsule."""
    return shapes.bodies[body, 1] - shapes.bodies[body, 0] > 2


@inlined
def place_axes(shapes: ContactShapes, poses: Array, axes: Array) -> None:
    """Fill in middles and halves of the axes of capsules around the arm's shapes, in the world."""
    for body in range(shapes.around.shape[0]):
        axis, link = shapes.around[body], shapes.bodies[body, 2]
        x, y, z = to_world(poses, link, axis[0], axis[1], axis[2])
        axes[body, 0], axes[body, 1], axes[body, 2] = x, y, z
        x, y, z = rotated(poses, link, axis[3], axis[4], axis[5])
        axes[body, 3], axes[body, 4], axes[body, 5] = x, y, z


@inlined
def extent(axes: Array, body: int, x: float, y: float, z: float) -> float:
    """How far the axis of a capsule around a shape reaches from its middle along a vector."""
    return abs(x * axes[body, 3] + y * axes[body, 4] + z * axes[body, 5])


@inlined
def axis_above(
    shapes: ContactShapes, pair: int, poses: Array, axes: Array, plane: Array, row: int
) -> float:
    """Least height of the capsule around a pair's mover above a row of the planes [m]."""
    base, mover = shapes.planes[pair, 4], shapes.planes[pair, 1]
    x, y, z = rotated(poses, base, plane[row, 0], plane[row, 1], plane[row, 2])
    middle = (
        x * (axes[mover, 0] - poses[base, 13])
        + y * (axes[mover, 1] - poses[base, 14])
        + z * (axes[mover, 2] - poses[base, 15])
    )
    return middle - extent(axes, mover, x, y, z) - plane[row, OFFSET] - shapes.around[mover, 6]


@inlined
def axes_apart(shapes: ContactShapes, pair: int, poses: Array, axes: Array) -> float:
    """Lower bound of a pair's distance, by the capsules around what is the arm's [m].

    It is measured along a half-space's normal, or from the nearest point of a box, or the middle of
    the other axis, to the middle of the mover's axis.
    """
    carrier, mover = shapes.planes[pair, 0], shapes.planes[pair, 1]
    frame, radius = shapes.bodies[carrier, 2], shapes.around[mover, 6]
    x, y, z = axes[mover, 0], axes[mover, 1], axes[mover, 2]
    if shapes.pairs[pair, 0] == WITH_HALFSPACE:
        nx, ny, nz, offset = surface(poses, frame)
        height = nx * x + ny * y + nz * z - offset - poses[frame, 3] - radius
        return height - extent(axes, mover, nx, ny, nz)
    reach = 0.0
    if is_placed(shapes, frame, poses):
        x, y, z = rotated(poses, frame, *off_box(shapes, carrier, (x, y, z), poses))
        radius = radius + poses[frame, 3]
    else:
        x, y, z = x - axes[carrier, 0], y - axes[carrier, 1], z - axes[carrier, 2]
        radius += shapes.around[carrier, 6]
        reach = extent(axes, carrier, x, y, z)
    norm = math.sqrt(x * x + y * y + z * z)
    return norm - (reach + extent(axes, mover, x, y, z)) / max(norm, 1e-9) - radius


@inlined
def ball_gap(shapes: ContactShapes, pair: int, poses: Array) -> float:
    """Lower bound of a pair's distance: of a ball from a ball, a box or a half-space [m]."""
    balls, carrier, mover = shapes.balls, shapes.planes[pair, 0], shapes.planes[pair, 1]
    frame, link = shapes.bodies[carrier, 2], shapes.bodies[mover, 2]
    x, y, z = to_world(poses, link, balls[mover, 0], balls[mover, 1], balls[mover, 2])
    around = balls[mover, 3] + shapes.rounding[mover]
    if shapes.pairs[pair, 0] == WITH_HALFSPACE:
        nx, ny, nz, offset = surface(poses, frame)
        return nx * x + ny * y + nz * z - offset - around - poses[frame, 3]
    if is_placed(shapes, frame, poses):
        x, y, z = off_box(shapes, carrier, (x, y, z), poses)
        around += poses[frame, 3]
    else:
        u, v, w = to_world(poses, frame, balls[carrier, 0], balls[carrier, 1], balls[carrier, 2])
        x, y, z, around = x - u, y - v, z - w, around + balls[carrier, 3] + shapes.rounding[carrier]
    return math.sqrt(x * x + y * y + z * z) - around
