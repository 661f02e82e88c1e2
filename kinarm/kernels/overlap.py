"""Proof that bodies touch, for a number or lanes.

It takes capsules in the shapes of the arm, and capsules, boxes and half-spaces that equal those of
the scene: two points that are closer than the radii about them prove an overlap.
"""

import math

from kinarm.contact_shapes import BETWEEN_CAPSULES, WITH_HALFSPACE, ContactShapes
from kinarm.kernels.compiling import Array, helper, inlined
from kinarm.kernels.distance import between_segments, closest_to_box
from kinarm.kernels.kinematics import to_frame
from kinarm.kernels.planes import axis_in_world, is_placed, surface


@inlined
def radius_of(shapes: ContactShapes, body: int, poses: Array) -> float:
    """Radius of a body's capsule [m]; minus infinity if nothing in the body is known."""
    frame = shapes.bodies[body, 2]
    radius = 0.0 * poses[0, 13] + shapes.capsules[body, 6]
    if is_placed(shapes, frame, poses):
        radius += poses[frame, 3]
    return radius


@helper
def overlap(shapes: ContactShapes, pair: int, poses: Array) -> float:
    """Lower bound of a pair's overlap, by what lies in its shapes [m]; negative if apart."""
    kind, first, second = shapes.pairs[pair, 0], shapes.pairs[pair, 1], shapes.pairs[pair, 2]
    a, b = axis_in_world(shapes, first, poses)
    radius = shapes.capsules[first, 6] + radius_of(shapes, second, poses)
    frame = shapes.bodies[second, 2]
    if kind == WITH_HALFSPACE:
        x, y, z, offset = surface(poses, frame)
        start, end = x * a[0] + y * a[1] + z * a[2], x * b[0] + y * b[1] + z * b[2]
        return radius - (min(start, end) - offset)
    if kind == BETWEEN_CAPSULES:
        c, d = axis_in_world(shapes, second, poses)
        x, y, z = between_segments(a, b, c, d)
    else:
        hx, hy, hz = poses[frame, 0], poses[frame, 1], poses[frame, 2]
        a, b = to_frame(poses, frame, a), to_frame(poses, frame, b)
        t = closest_to_box(a, b, (-hx, -hy, -hz), (hx, hy, hz))
        x, y, z = a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])
        x -= min(max(x, -hx), hx)
        y -= min(max(y, -hy), hy)
        z -= min(max(z, -hz), hz)
    return radius - math.sqrt(x * x + y * y + z * z)


@inlined
def deepest_overlap(shapes: ContactShapes, poses: Array) -> float:
    """Lower bound of the deepest overlap of all pairs [m]."""
    depth = 0.0 * poses[0, 13] - 1.0
    for pair in range(shapes.pairs.shape[0]):
        depth = max(depth, overlap(shapes, pair, poses))
    return depth
