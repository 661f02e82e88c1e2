"""Proof that steps are free of contact, or that bodies touch, for a block of episodes.

A step moves the arm from q to q' and is tested at n configurations q + k/n (q' - q); n = 0 stands
for all of its motion, in `INTERVALS`. Bodies of the scene that move do so straight. The height h of
the second body of a pair above the plane of the first (`kinarm.kernels.planes`) is known at q.
Along the step it is the least height of some corners, whose second derivative is bounded by a
*bend* c: at the share s it is at least (1 - s) h + s h' - s (1 - s) c / 2. Where that proves
nothing, a better plane is taken, and then each configuration or interval between.
"""

import math

from kinarm.chain import Chain
from kinarm.contact_shapes import PLANE, WITH_HALFSPACE, ContactShapes
from kinarm.episodes import INTERVALS
from kinarm.kernels.compiling import Array, helper, inlined
from kinarm.kernels.lane_copies import moving_frame, place_between, put, take, take_rows
from kinarm.kernels.lanes import any_lane, as_numbers, select
from kinarm.kernels.planes import (
    DEPTH,
    EVERYDAY,
    FINE,
    GAP,
    approach,
    height_above,
    propose,
    separate,
)
from kinarm.kernels.rough_bounds import axis_above, has_corners, place_axes
from kinarm.kernels.work_space import Alone, Block

MARGIN = 2e-6
"""Distance beyond which freedom is claimed [m].

Coal calls contact what is up to 1e-6 m apart, and some 1e-9 m more.
"""

SURE_CONTACT, SURE_FREEDOM = 0.99e-6, 1.25e-6
"""Distances that are contact, and freedom, in such a step, where Coal need not agree [m]."""


@inlined
def tested_from(tested: int) -> float:
    """Share of a step at which the test begins."""
    return 1.0 / tested if tested > 0 else 0.0


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

    Takes the poses at the target. One bend, larger than any pair's, serves for all. The capsule
    around a mover has a height, too, and mostly that is enough. Pairs that stay open are listed.
    """
    twist_step(block)
    bend = 0.0 * block.q[0, 0]
    for axis in range(block.twist.shape[0]):
        bend += block.twist[0, axis] * shapes.farthest[axis]
    bent, least, share, n_open = 0.125 * bend, bend + 1.0, tested_from(tested), 0
    place_axes(shapes, poses, block.axes)
    for pair in range(shapes.travel.shape[1]):
        before = block.planes[pair, GAP]
        after = axis_above(shapes, pair, poses, block.axes, block.planes, pair)
        bound = min(after, before + share * (after - before)) - bent
        block.height[pair] = before
        unproven = ~is_apart(bound)
        if any_lane(unproven):
            if has_corners(shapes, shapes.proxies[pair, EVERYDAY, 1]):
                # Of the others, nothing may depend on who shares the block.
                closer = height_above(shapes, pair, EVERYDAY, poses, block.planes, pair)
                after = select(unproven, closer, after)
                bound = min(after, before + share * (after - before)) - bent
            if any_lane(~is_apart(bound)):
                block.open[n_open], block.bound[pair] = pair, bound
                n_open += 1
        block.planes[pair, GAP] = after
        least = min(least, bound)
    block.open[shapes.travel.shape[1]] = n_open
    return least


@inlined
def renew_planes(
    shapes: ContactShapes, tested: int, stale: bool, before: Array, poses: Array, block: Block
) -> float:
    """Prove steps by the pairs' own bends, or by new planes; return the bound.

    ``stale`` says whose steps are to be proven. Poses are ``before`` the step and at the target.
    """
    least = 0.0 * block.q[0, 0] + 1.0
    n_pairs, share = shapes.travel.shape[1], tested_from(tested)
    for index in range(block.open[n_pairs]):
        pair = block.open[index]
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
def open_parts(before: float, after: float, bend: float, tested: int) -> int:
    """Bit k - 1 is set if the heights do not prove configuration, or interval, k free."""
    unproven, parts = 0, tested if tested > 0 else INTERVALS
    # Where the bound, a parabola that opens upwards, is lowest.
    lowest = 0.5 - (after - before) / bend if bend > 0.0 else 0.0 if before < after else 1.0
    for k in range(1, parts + 1):
        share = k / parts
        if tested == 0:
            share = min(max(lowest, (k - 1) / parts), share)
        height = (1.0 - share) * before + share * after - 0.5 * share * (1.0 - share) * bend
        unproven |= 0 if is_apart(height) else 1 << (k - 1)
    return unproven


@helper
def prove_alone(
    lane: int,
    chain: Chain,
    shapes: ContactShapes,
    tested: int,
    before: Array,
    poses: Array,
    block: Block,
    alone: Alone,
    quick: bool = False,
) -> int:
    """Prove what `prove_step` has not of an episode's step, and better its planes.

    Poses are ``before`` the step and at the target. Returns a number whose bit k - 1 is set if
    configuration, or interval, k is not proven free. Of a step that is tested throughout, it is
    minus the number, from 1, of a pair that touches in it. If it shall be ``quick``, it is
    that of any pair in doubt, and suspected pairs are looked at first.
    """
    plane, planes = alone.plane, as_numbers(block.planes)
    heights, bends = as_numbers(block.height), as_numbers(block.bend)
    # Better the planes of pairs that are not proven, and list those that remain.
    take_rows(poses, lane, alone.after)
    for k in range(shapes.moving.shape[0]):
        frame = moving_frame(shapes, k, poses)
        for i in range(3):
            alone.moved[k, i] = as_numbers(before)[frame, 13 + i, lane]
            alone.moved[k, 3 + i] = as_numbers(poses)[frame, 13 + i, lane]
    at_start, n_open, all_open, n_left = False, 0, 0, block.open[shapes.travel.shape[1]]
    for index in range(-n_left if quick else 0, n_left):
        pair = block.open[index + n_left if index < 0 else index]
        if quick and alone.suspected[pair] == (index >= 0):
            continue
        if is_apart(as_numbers(block.bound)[pair, lane]):
            continue
        if tested == 0 and approach(shapes, pair, alone.after)[0] > -SURE_CONTACT:
            return -1 - pair
        bend = bends[pair, lane]
        first, last = heights[pair, lane], planes[pair, GAP, lane]
        unproven = open_parts(first, last, bend, tested)
        if unproven != 0 and shapes.pairs[pair, 0] != WITH_HALFSPACE:
            if not at_start:
                place_between(0, 1, lane, chain, shapes, block, alone, alone.before)
                at_start = True
            take(block.planes, pair, lane, plane, 0)
            work = alone.relative, alone.simplex, plane
            last, touching = separate(shapes, pair, alone.after, *work)
            if tested == 0 and touching:
                return -1 - pair
            first = height_above(shapes, pair, FINE, alone.before, plane, 0)
            unproven = open_parts(first, last, bend, tested)
            heights[pair, lane] = first
            put(plane, 0, block.planes, pair, lane)
        if quick and tested > 0 and unproven >> (tested - 1) & 1:
            return -1 - pair
        alone.listed[n_open, 0], alone.listed[n_open, 1] = pair, unproven
        n_open += 0 if unproven == 0 else 1
        all_open |= unproven
    # Look at each part up to the first pair that stays in doubt; the target has been looked at.
    parts = tested if tested > 0 else INTERVALS
    doubt = all_open & (1 << (tested - 1)) if tested > 0 else 0
    for k in range(1, parts if tested > 0 else parts + 1):
        bit = 1 << (k - 1)
        if all_open & bit == 0:
            continue
        given = bit, n_open, tested, lane, chain, shapes, block, alone
        refused = refusing_pair(k, parts, *given)
        if refused >= 0 and tested == 0 and doubt == 0:
            # The first interval in doubt is worth a closer look.
            refused, finer = -1, INTERVALS * parts
            for j in range(INTERVALS * (k - 1) + 1, INTERVALS * k + 1):
                if refused == -1:
                    refused = refusing_pair(j, finer, *given)
        if refused < -1:
            return 1 + refused
        if quick and refused >= 0:
            return -1 - refused
        doubt |= 0 if refused < 0 else bit
    return doubt


@helper
def refusing_pair(
    k: int,
    parts: int,
    bit: int,
    n_open: int,
    tested: int,
    lane: int,
    chain: Chain,
    shapes: ContactShapes,
    block: Block,
    alone: Alone,
) -> int:
    """First listed pair with a bit that is not proven free at configuration k, or to it, or -1.

    Of a step that is tested throughout, it is -2 less the pair if that surely touches there.
    """
    bends = as_numbers(block.bend)
    if tested == 0:
        place_between(k - 1, parts, lane, chain, shapes, block, alone, alone.after)
    place_between(k, parts, lane, chain, shapes, block, alone, alone.before)
    for index in range(n_open):
        pair = alone.listed[index, 0]
        if alone.listed[index, 1] & bit != 0:
            bend = bends[pair, lane] / (parts * parts) if tested == 0 else -1.0
            verdict = verdict_of(pair, lane, bend, shapes, block, alone)
            if verdict < 1:
                return int(pair) if verdict == 0 or tested > 0 else -2 - int(pair)
    return -1


@inlined
def verdict_of(
    pair: int, lane: int, bend: float, shapes: ContactShapes, block: Block, alone: Alone
) -> int:
    """1 if its or a better plane proves a pair apart at ``alone.before``, -1 if it touches, else 0.

    Unless the bend is negative, it is apart also on the way from ``alone.after``, which bends so
    far.
    """
    touching = False
    take(block.planes, pair, lane, alone.plane, 0)
    height = height_above(shapes, pair, FINE, alone.before, alone.plane, 0)
    if shapes.pairs[pair, 0] == WITH_HALFSPACE:
        touching = height + shapes.excess[shapes.proxies[pair, FINE, 1]] < -DEPTH
    if bend >= 0.0:
        height = min(height, height_above(shapes, pair, FINE, alone.after, alone.plane, 0))
        height -= 0.125 * bend
    if not is_apart(height) and shapes.pairs[pair, 0] != WITH_HALFSPACE:
        work = alone.relative, alone.simplex, alone.plane
        enough = MARGIN if bend < 0.0 else math.inf
        height, touching = separate(shapes, pair, alone.before, *work, enough)
        if bend >= 0.0:
            height = min(height, height_above(shapes, pair, FINE, alone.after, alone.plane, 0))
            height -= 0.125 * bend
    apart = height > (SURE_FREEDOM if bend >= 0.0 else MARGIN)
    return 1 if apart else -1 if touching else 0


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

    Looks at the first configuration that ``doubt`` does not show as free. Of a step that is tested
    throughout, it is a pair that touches, perhaps not first.
    """
    if doubt < 0:
        return -doubt
    k = 1
    while doubt >> (k - 1) & 1 == 0:
        k += 1
    parts = tested if tested > 0 else INTERVALS
    place_between(k, parts, lane, chain, shapes, block, alone, alone.before)
    enough = DEPTH if tested > 0 else -SURE_CONTACT
    for pair in range(shapes.travel.shape[1]):
        if approach(shapes, pair, alone.before)[0] > enough:
            return pair + 1
        verdict = verdict_of(pair, lane, -1.0, shapes, block, alone)
        if verdict < 0:
            return pair + 1
        if tested > 0 and verdict == 0:
            return 0
    return 0
