"""Proof of contact between bodies whose shapes are known exactly, for a number or lanes.

Such bodies are capsules, obstacles and the ground. Two points of them that are closer to each
other than the radii about them prove that they overlap, wherever these points come from. Of arms
with other shapes nothing is claimed.
"""

import math

from kinarm.chain import Chain
from kinarm.contact_shapes import BETWEEN_CAPSULES, WITH_GROUND, ContactShapes
from kinarm.kernels.block import Alone, Block, take
from kinarm.kernels.compiling import Array, helper, inlined
from kinarm.kernels.distance import between_segments, closest_to_box, turned_back
from kinarm.kernels.kinematics import place
from kinarm.kernels.planes import axis_in_world
from kinarm.kernels.proof import MARGIN, is_proven_apart, place_between


@inlined
def is_exact(shapes: ContactShapes, pair: int) -> bool:
    """Whether the shapes of a pair are known exactly."""
    kind, first, second = shapes.pairs[pair, 0], shapes.pairs[pair, 1], shapes.pairs[pair, 2]
    return shapes.exact[first] and (kind != BETWEEN_CAPSULES or shapes.exact[second])


@helper
def overlap(shapes: ContactShapes, pair: int, poses: Array) -> float:
    """Lower bound of how deep an exact pair overlaps [m]; negative if it may be apart."""
    kind, first, second = shapes.pairs[pair, 0], shapes.pairs[pair, 1], shapes.pairs[pair, 2]
    a, b = axis_in_world(shapes, first, poses)
    radius = shapes.capsules[first, 6]
    if kind == WITH_GROUND:
        return radius - min(a[2], b[2])
    if kind == BETWEEN_CAPSULES:
        c, d = axis_in_world(shapes, second, poses)
        x, y, z = between_segments(a, b, c, d)
        radius += shapes.capsules[second, 6]
    else:
        low, high = shapes.boxes[second, 0], shapes.boxes[second, 1]
        lower, upper = (low[0], low[1], low[2]), (high[0], high[1], high[2])
        cosine, sine = shapes.turns[second, 0], shapes.turns[second, 1]
        a, b = turned_back(a, cosine, sine), turned_back(b, cosine, sine)
        t = closest_to_box(a, b, lower, upper)
        x, y, z = a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])
        x -= min(max(x, lower[0]), upper[0])
        y -= min(max(y, lower[1]), upper[1])
        z -= min(max(z, lower[2]), upper[2])
    return radius - math.sqrt(x * x + y * y + z * z)


@inlined
def deepest_overlap(shapes: ContactShapes, poses: Array) -> float:
    """Lower bound of how deep the deepest of all exact pairs overlaps [m]."""
    depth = 0.0 * poses[0, 13] - 1.0
    for pair in range(shapes.pairs.shape[0]):
        if is_exact(shapes, pair):
            depth = max(depth, overlap(shapes, pair, poses))
    return depth


@helper
def first_contact(
    lane: int,
    doubt: int,
    chain: Chain,
    shapes: ContactShapes,
    tested: int,
    block: Block,
    alone: Alone,
) -> int:
    """Number, from 1, of the pair that surely is the first to touch in a step; 0 if none is.

    Looks at the first configuration of which the bits of ``doubt`` say that it is not proven free.
    """
    k = 1
    while doubt >> (k - 1) & 1 == 0:
        k += 1
    if k == tested:
        take(block.target, 0, lane, alone.q, 0)
        place(chain, alone.q, alone.before)
    else:
        place_between(k, tested, lane, chain, block, alone)
    for pair in range(shapes.pairs.shape[0]):
        if is_exact(shapes, pair) and overlap(shapes, pair, alone.before) > MARGIN:
            return pair + 1
        if not is_proven_apart(pair, lane, shapes, block, alone):
            return 0
    return 0
