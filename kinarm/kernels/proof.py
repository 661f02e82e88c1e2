"""Proof that steps are free of contact, or that bodies touch, for a block of episodes.

A step moves the arm from q to q' and is tested at n configurations q + k/n (q' - q). The height h
of the second body of a pair above the plane of the first (`kinarm.kernels.planes`) is known at q.
Along the step it is the least height of some corners, whose second derivative is bounded by a
*bend* c: at the share s it is at least (1 - s) h + s h' - s (1 - s) c / 2. Where that proves
nothing, a better plane is taken, and then each configuration between.

Contact is proven by capsules in the shapes of the arm, and by capsules, boxes and half-spaces that
equal those of the scene: two points that are closer than the radii about them prove an overlap.
"""

import math

from kinarm.chain import Chain
from kinarm.contact_shapes import BETWEEN_CAPSULES, PLANE, WITH_HALFSPACE, ContactShapes
from kinarm.kernels.compiling import Array, helper, inlined
from kinarm.kernels.distance import between_segments, closest_to_box
from kinarm.kernels.kinematics import forward_kinematics, to_frame
from kinarm.kernels.lanes import any_lane, as_numbers, lane_bits, select
from kinarm.kernels.planes import (
    EVERYDAY,
    FINE,
    GAP,
    axis_in_world,
    height_above,
    is_placed,
    propose,
    separate,
    surface,
)
from kinarm.kernels.session import Alone, Block, put, take, take_rows

MARGIN, DEPTH = 2e-6, 1e-6
"""Distance beyond which freedom is claimed, and depth beyond which contact is [m].

Coal calls contact what is up to 1e-6 m apart, and some 1e-9 m more.
"""


@inlined
def is_apart(bound: float) -> bool:
    """Whether a lower bound of a distance proves freedom; NaN proves nothing."""
    return bound > MARGIN


@inlined
def twist_step(block: Block) -> None:
    """Fill in how the axes of a block move together in a step.

    The second derivative of a point by two axes is at most its speed by the later one, which the
    earlier one only turns.
    """
    n_axes = block.twist.shape[0]
    for first in range(n_axes):
        before = 0.0 * block.q[0, 0]
        for axis in range(first, n_axes):
            turn = abs(block.target[0, axis] - block.q[0, axis])
            block.twist[first, axis] = turn * (turn + 2.0 * before)
            before += turn


@inlined
def prove_step(shapes: ContactShapes, tested: int, poses: Array, block: Block) -> float:
    """Renew the heights of all pairs; return a bound that shows which steps are free.

    Takes the poses at the target. One bend, larger than any pair's, serves for all.
    """
    twist_step(block)
    bend = 0.0 * block.q[0, 0]
    for axis in range(block.twist.shape[0]):
        bend += block.twist[0, axis] * shapes.farthest[axis]
    bent, least, share = 0.125 * bend, bend + 1.0, 1.0 / tested
    for pair in range(shapes.planes.shape[0]):
        before = block.planes[pair, GAP]
        after = height_above(shapes, pair, EVERYDAY, poses, block.planes, pair)
        bound = min(after, before + share * (after - before)) - bent
        block.height[pair], block.bound[pair], block.planes[pair, GAP] = before, bound, after
        least = min(least, bound)
    return least


@inlined
def renew_planes(
    shapes: ContactShapes, tested: int, stale: bool, before: Array, poses: Array, block: Block
) -> float:
    """Prove steps by the pairs' own bends, or by new planes; return the bound.

    ``stale`` says whose steps are to be proven. Poses are ``before`` the step and at the target.
    """
    least = 0.0 * block.q[0, 0] + 1.0
    n_pairs, share = shapes.planes.shape[0], 1.0 / tested
    for pair in range(n_pairs):
        bound = block.bound[pair]
        open_here = stale & ~is_apart(bound)
        if any_lane(open_here):
            first, last = shapes.planes[pair, 2], shapes.planes[pair, 3]
            bend = 0.0 * block.q[0, 0]
            for axis in range(first, last):
                bend += block.twist[first, axis] * shapes.travel[axis, pair]
            at_start, at_end = block.height[pair], block.planes[pair, GAP]
            bound = min(at_end, at_start + share * (at_end - at_start)) - 0.125 * bend
            open_here = stale & ~is_apart(bound)
            if shapes.pairs[pair, 0] != WITH_HALFSPACE and any_lane(open_here):
                propose(shapes, pair, poses, block.planes, n_pairs)
                at_start = height_above(shapes, pair, EVERYDAY, before, block.planes, n_pairs)
                at_end = height_above(shapes, pair, EVERYDAY, poses, block.planes, n_pairs)
                renewed = min(at_end, at_start + share * (at_end - at_start)) - 0.125 * bend
                better = open_here & (renewed > bound)
                bound = select(better, renewed, bound)
                block.height[pair] = select(better, at_start, block.height[pair])
                block.planes[n_pairs, GAP] = at_end
                for i in range(PLANE):
                    kept, proposed = block.planes[pair, i], block.planes[n_pairs, i]
                    block.planes[pair, i] = select(better, proposed, kept)
            block.bend[pair], block.bound[pair] = bend, bound
        least = min(least, bound)
    return least


@inlined
def open_configurations(before: float, after: float, bend: float, tested: int) -> int:
    """Bit k - 1 is set if the heights do not prove configuration k free."""
    unproven = 0
    for k in range(1, tested + 1):
        share = k / tested
        height = (1.0 - share) * before + share * after - 0.5 * share * (1.0 - share) * bend
        unproven |= 0 if is_apart(height) else 1 << (k - 1)
    return unproven


@helper
def prove_alone(
    lane: int,
    chain: Chain,
    shapes: ContactShapes,
    tested: int,
    poses: Array,
    block: Block,
    alone: Alone,
) -> int:
    """Prove what `prove_step` has not of an episode's step, and better its planes.

    Returns a number whose bit k - 1 is set if configuration k is not proven free.
    """
    plane, planes = alone.plane, as_numbers(block.planes)
    heights, bends = as_numbers(block.height), as_numbers(block.bend)
    # Better the planes of pairs that are not proven, and list those that remain.
    take_rows(poses, lane, alone.after)
    at_start, n_open, all_open, target_bit = False, 0, 0, 1 << (tested - 1)
    for pair in range(shapes.planes.shape[0]):
        if is_apart(as_numbers(block.bound)[pair, lane]):
            continue
        bend = bends[pair, lane]
        before, after = heights[pair, lane], planes[pair, GAP, lane]
        unproven = open_configurations(before, after, bend, tested)
        if unproven != 0 and shapes.pairs[pair, 0] != WITH_HALFSPACE:
            if not at_start:
                take(block.q, 0, lane, alone.q, 0)
                forward_kinematics(chain, alone.q, 0, alone.before)
                at_start = True
            take(block.planes, pair, lane, plane, 0)
            after = separate(shapes, pair, alone.after, alone.relative, alone.simplex, plane)
            before = height_above(shapes, pair, FINE, alone.before, plane, 0)
            unproven = open_configurations(before, after, bend, tested)
            heights[pair, lane] = before
            put(plane, 0, block.planes, pair, lane)
        alone.listed[n_open, 0], alone.listed[n_open, 1] = pair, unproven
        n_open += 0 if unproven == 0 else 1
        all_open |= unproven
    # Look at configurations between up to the first pair that stays in doubt.
    doubt = all_open & target_bit
    for k in range(1, tested):
        bit = 1 << (k - 1)
        if all_open & bit == 0:
            continue
        place_between(k, tested, lane, chain, block, alone)
        for index in range(n_open):
            pair = alone.listed[index, 0]
            if alone.listed[index, 1] & bit == 0:
                continue
            if not is_proven_apart(pair, lane, shapes, block, alone):
                doubt |= bit
                break
    return doubt


@inlined
def is_proven_apart(
    pair: int, lane: int, shapes: ContactShapes, block: Block, alone: Alone
) -> bool:
    """Whether its or a better plane proves a pair apart at ``alone.before``."""
    take(block.planes, pair, lane, alone.plane, 0)
    height = height_above(shapes, pair, FINE, alone.before, alone.plane, 0)
    if not is_apart(height) and shapes.pairs[pair, 0] != WITH_HALFSPACE:
        height = separate(shapes, pair, alone.before, alone.relative, alone.simplex, alone.plane)
    return is_apart(height)


@inlined
def place_between(k: int, tested: int, lane: int, chain: Chain, block: Block, alone: Alone) -> None:
    """Fill in an episode's poses at configuration k < ``tested`` of its step."""
    q, target = as_numbers(block.q), as_numbers(block.target)
    for joint in range(block.q.shape[1]):
        start, end = q[0, joint, lane], target[0, joint, lane]
        alone.q[0, joint] = start + k / tested * (end - start)
    forward_kinematics(chain, alone.q, 0, alone.before)


@helper
def prove_configuration(
    lane: int, shapes: ContactShapes, poses: Array, block: Block, alone: Alone
) -> bool:
    """Prove an episode's configuration free as far as first planes have not."""
    plane, planes = alone.plane, as_numbers(block.planes)
    take_rows(poses, lane, alone.after)
    for pair in range(shapes.planes.shape[0]):
        if is_apart(planes[pair, GAP, lane]):
            continue
        if shapes.pairs[pair, 0] == WITH_HALFSPACE:
            return False
        take(block.planes, pair, lane, plane, 0)
        height = separate(shapes, pair, alone.after, alone.relative, alone.simplex, plane)
        put(plane, 0, block.planes, pair, lane)
        if not is_apart(height):
            return False
    return True


@inlined
def prove_configurations(
    shapes: ContactShapes, touched: int, filled: int, block: Block, alone: Alone
) -> int:
    """Bits of the arms that are proven free; ``touched`` are those that are not.

    Takes the poses ``after``, and gives all pairs a first plane.
    """
    least = 0.0 * block.q[0, 0] + 1.0
    for pair in range(shapes.planes.shape[0]):
        propose(shapes, pair, block.after, block.planes, pair)
        height = height_above(shapes, pair, EVERYDAY, block.after, block.planes, pair)
        block.planes[pair, GAP] = height
        least = min(least, height)
    free = lane_bits(is_apart(least))
    for lane in range(filled):
        open_here = (free | touched) >> lane & 1 == 0
        if open_here and prove_configuration(lane, shapes, block.after, block, alone):
            free |= 1 << lane
    return free


@inlined
def is_exact(shapes: ContactShapes, pair: int) -> bool:
    """Whether the shapes of a pair are known exactly."""
    return shapes.exact[shapes.pairs[pair, 1]] and shapes.exact[shapes.pairs[pair, 2]]


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
    """Number, from 1, of the pair that surely touches first in a step; 0 if none is.

    Looks at the first configuration that ``doubt`` does not show as free.
    """
    k = 1
    while doubt >> (k - 1) & 1 == 0:
        k += 1
    if k == tested:
        take(block.target, 0, lane, alone.q, 0)
        forward_kinematics(chain, alone.q, 0, alone.before)
    else:
        place_between(k, tested, lane, chain, block, alone)
    for pair in range(shapes.pairs.shape[0]):
        if overlap(shapes, pair, alone.before) > DEPTH:
            return pair + 1
        if not is_proven_apart(pair, lane, shapes, block, alone):
            return 0
    return 0
