"""The shield: a step that touches is replaced by the nearest one that is proven free.

First it is projected off the planes of the pairs that touch, one after the other. Then shares of it
are tried, joint by joint, in the order of their distance from it, and at last the arm rests.
"""

import math

from kinarm.chain import Chain
from kinarm.contact_shapes import WITH_HALFSPACE, ContactShapes
from kinarm.episodes import Episodes, Rules
from kinarm.kernels.compiling import helper, inlined
from kinarm.kernels.kinematics import forward_kinematics
from kinarm.kernels.lanes import as_numbers
from kinarm.kernels.planes import FINE, height_above, separate
from kinarm.kernels.session import Alone, Block, place_between, take

PROJECTIONS = 3
"""Attempts at a projection."""

KEPT = 1e-3
"""Distance that a projected step keeps [m]."""

DIFFERENCE = 1e-6
"""Move of a joint for the slope of a height [rad or m]."""


@inlined
def fails_again(e: int, pair: int, episodes: Episodes) -> None:
    """Note that an episode's step touches a pair, from 1; 0 if that is not known."""
    if episodes.attempt[e] == 0:
        episodes.tried[e] = 0.0
        episodes.blocker[e] = pair
    episodes.attempt[e] += 1
    episodes.touched[e] = pair


@helper
def replace_step(
    lane: int,
    e: int,
    chain: Chain,
    shapes: ContactShapes,
    rules: Rules,
    episodes: Episodes,
    block: Block,
    alone: Alone,
) -> None:
    """Fill in the next target of an episode whose step has touched something."""
    q, target = as_numbers(block.q), as_numbers(block.target)
    action, pair = as_numbers(block.action), episodes.touched[e] - 1
    n_actuated = rules.step_limit.shape[0]
    if episodes.attempt[e] <= PROJECTIONS and pair >= 0:
        project_step(lane, pair, chain, shapes, rules, block, alone)
        return
    chosen, nearest = -1, math.inf
    for k in range(rules.shield.shape[0]):
        off = 0.0
        for axis in range(n_actuated):
            start = q[0, axis, lane]
            wanted = start + action[0, axis, lane] * rules.step_limit[axis]
            wanted = min(max(wanted, chain.lower[axis]), chain.upper[axis])
            left = (1.0 - rules.shield[k, axis]) * (wanted - start)
            off += left * left
        if off > episodes.tried[e] and off < nearest:
            chosen, nearest = k, off
    for axis in range(n_actuated):
        start = q[0, axis, lane]
        wanted = start + action[0, axis, lane] * rules.step_limit[axis]
        wanted = min(max(wanted, chain.lower[axis]), chain.upper[axis])
        share = rules.shield[chosen, axis] if chosen >= 0 else 0.0
        moved = start + share * (wanted - start)
        target[0, axis, lane] = min(max(moved, chain.lower[axis]), chain.upper[axis])
    episodes.tried[e] = nearest
    if chosen < 0 and shapes.moving.shape[0] == 0:
        # Where the arm rests, it is known to be free.
        as_numbers(block.cleared)[0, lane] = 1.0


@inlined
def project_step(
    lane: int,
    pair: int,
    chain: Chain,
    shapes: ContactShapes,
    rules: Rules,
    block: Block,
    alone: Alone,
) -> None:
    """Project an episode's target off the plane between two bodies."""
    q, target, plane = as_numbers(block.q), as_numbers(block.target), alone.plane
    n_actuated = rules.step_limit.shape[0]
    place_between(0, 1, lane, chain, shapes, block, alone, alone.before)
    place_between(0, 1, lane, chain, shapes, block, alone, alone.after)
    take(block.planes, pair, lane, plane, 0)
    if shapes.pairs[pair, 0] != WITH_HALFSPACE:
        separate(shapes, pair, alone.before, alone.relative, alone.simplex, plane)
    height = height_above(shapes, pair, FINE, alone.before, plane, 0)
    ahead, squares = height, 1e-12
    for axis in range(n_actuated):
        alone.q[0, axis] = q[0, axis, lane] + DIFFERENCE
        forward_kinematics(chain, alone.q, 0, alone.after)
        slope = (height_above(shapes, pair, FINE, alone.after, plane, 0) - height) / DIFFERENCE
        alone.q[0, axis] = q[0, axis, lane]
        alone.slopes[0, axis] = slope
        ahead += slope * (target[0, axis, lane] - q[0, axis, lane])
        squares += slope * slope
    pushed = max(KEPT - ahead, 0.0) / squares
    for axis in range(n_actuated):
        start, limit = q[0, axis, lane], rules.step_limit[axis]
        moved = target[0, axis, lane] + pushed * alone.slopes[0, axis]
        moved = min(max(moved, start - limit), start + limit)
        target[0, axis, lane] = min(max(moved, chain.lower[axis]), chain.upper[axis])


@inlined
def take_down(lane: int, e: int, episodes: Episodes, block: Block) -> None:
    """Count a step that was replaced, and note which pair would have touched."""
    episodes.interventions[e] += 1
    if episodes.replaced.shape[0] > 0:
        step = int(as_numbers(block.steps)[0, lane]) - 1
        episodes.replaced[e, step] = episodes.blocker[e]
    episodes.attempt[e] = 0
    as_numbers(block.attempt)[0, lane] = 0.0
