"""The shield: a step that touches is replaced by the nearest one that is proven free.

Shares of it are tried, joint by joint, in the order of their distance from it, and among them its
projection off the plane between the bodies that touch. At last the arm rests.
"""

import math

from kinarm.chain import Chain
from kinarm.contact_shapes import WITH_HALFSPACE, ContactShapes
from kinarm.episodes import Episodes, Rules
from kinarm.kernels.compiling import Array, helper, inlined
from kinarm.kernels.kinematics import forward_kinematics, place_bodies
from kinarm.kernels.lane_copies import place_between, take
from kinarm.kernels.lanes import as_numbers
from kinarm.kernels.planes import FINE, height_above, separate
from kinarm.kernels.session import Alone, Block

PROJECTIONS = 3
"""Largest number of projections, each of the one before."""

TRIED = -1.0
"""Distance of a projection that has been tried, or not been made."""

KEPT = 1e-3
"""Distance that a projected step keeps [m]."""

DIFFERENCE = 1e-6
"""Move of a joint for the slope of a height [rad or m]."""


@inlined
def fails_again(e: int, pair: int, episodes: Episodes) -> None:
    """Note that an episode's step touches a pair, from 1; 0 if that is not known."""
    last = episodes.projected.shape[1] - 2
    if episodes.attempt[e] == 0:
        episodes.tried[e], episodes.blocker[e] = 0.0, pair if pair > 0 else -1
        episodes.projected[e, last], episodes.projected[e, last + 1] = TRIED, 0.0
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
    """Fill in the next target of an episode whose step, or what replaced it, touches."""
    q, target = as_numbers(block.q), as_numbers(block.target)
    n_actuated, pair = rules.step_limit.shape[0], episodes.touched[e] - 1
    projected, step = episodes.projected[e], alone.step[0]
    for axis in range(n_actuated):
        start = q[0, axis, lane]
        moved = start + as_numbers(block.action)[0, axis, lane] * rules.step_limit[axis]
        step[axis] = min(max(moved, chain.lower[axis]), chain.upper[axis]) - start
    if projected[n_actuated] == TRIED:
        projected[n_actuated] = math.inf
        if pair >= 0 and projected[n_actuated + 1] < PROJECTIONS:
            projected[n_actuated + 1] += 1.0
            place_scene(lane, e, shapes, rules, episodes, block, alone)
            project_step(lane, pair, chain, shapes, rules, projected, block, alone)
    chosen, nearest = -1, projected[n_actuated]
    for k in range(rules.shield.shape[0]):
        off = 0.0
        for axis in range(n_actuated):
            left = (1.0 - rules.shield[k, axis]) * step[axis]
            off += left * left
        if off > episodes.tried[e] and off < nearest:
            chosen, nearest = k, off
    projects = chosen < 0 and nearest < math.inf
    for axis in range(n_actuated):
        moved = q[0, axis, lane]
        if chosen >= 0:
            moved += rules.shield[chosen, axis] * step[axis]
        elif projects:
            moved = projected[axis]
        target[0, axis, lane] = min(max(moved, chain.lower[axis]), chain.upper[axis])
    episodes.tried[e] = max(episodes.tried[e], nearest)
    if projects:
        projected[n_actuated] = TRIED
    elif chosen < 0 and shapes.moving.shape[0] == 0:
        # Where the arm rests, it is known to be free.
        as_numbers(block.cleared)[0, lane] = 1.0


@inlined
def place_scene(
    lane: int,
    e: int,
    shapes: ContactShapes,
    rules: Rules,
    episodes: Episodes,
    block: Block,
    alone: Alone,
) -> None:
    """Put an episode's bodies where they are at the end of its step, if they are its own."""
    if episodes.scenes.shape[0] > 0:
        place_bodies(episodes.scenes[e], alone.before)
        place_bodies(episodes.scenes[e], alone.after)
        step = int(as_numbers(block.steps)[0, lane]) + 1
        for k in range(shapes.moving.shape[0]):
            for i in range(3):
                position = episodes.scenes[e, shapes.moving[k], 13 + i] + rules.moves[step, k, i]
                alone.moved[k, i] = alone.moved[k, 3 + i] = position


@inlined
def project_step(
    lane: int,
    pair: int,
    chain: Chain,
    shapes: ContactShapes,
    rules: Rules,
    projected: Array,
    block: Block,
    alone: Alone,
) -> None:
    """Project an episode's target off the plane between two bodies.

    Fills in joint positions, and their squared distance from the step that was wanted.
    """
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
    pushed, off = max(KEPT - ahead, 0.0) / squares, 0.0
    for axis in range(n_actuated):
        start, limit = q[0, axis, lane], rules.step_limit[axis]
        moved = target[0, axis, lane] + pushed * alone.slopes[0, axis]
        moved = min(max(moved, start - limit), start + limit)
        projected[axis] = min(max(moved, chain.lower[axis]), chain.upper[axis])
        left = projected[axis] - start - alone.step[0, axis]
        off += left * left
    projected[n_actuated] = off


@inlined
def take_down(lane: int, e: int, episodes: Episodes, block: Block) -> None:
    """Count a step that was replaced, and note which pair would have touched."""
    episodes.interventions[e] += 1
    if episodes.replaced.shape[0] > 0:
        step = int(as_numbers(block.steps)[0, lane]) - 1
        episodes.replaced[e, step] = episodes.blocker[e]
    episodes.attempt[e] = 0
    as_numbers(block.attempt)[0, lane] = 0.0
