"""The shield: a step that touches is replaced by the nearest one that is proven free.

Shares of it are tried, joint by joint, in the order of their distance from it, and among them its
projection off the plane between the bodies that touch. At last the arm rests.

Joints that lag go on when their command rests. So a step counts as free only if what follows from
holding its command is, too, until the joints rest: shares are those of the command's move, and at
last the command of the step before is held, which was proven then. Where bodies move, arms have to
be free of where these will be in `WARNING` seconds, if they go on as in the step.
"""

import math

from kinarm.chain import Chain
from kinarm.contact_shapes import WITH_HALFSPACE, ContactShapes
from kinarm.episodes import Episodes, Rules
from kinarm.kernels.block_proof import doubtful_steps
from kinarm.kernels.compiling import Array, helper, inlined
from kinarm.kernels.kinematics import forward_kinematics, place_bodies, rotated
from kinarm.kernels.lane_copies import move_bodies, moving_frame, place_between, take
from kinarm.kernels.lanes import LANES, as_numbers, lane_bits, select
from kinarm.kernels.planes import FINE, GAP, height_above, separate
from kinarm.kernels.plant import (
    CHANGE,
    COMMAND,
    DELAY,
    OFFSETS,
    RATE,
    STEADY,
    VELOCITY,
    move_joints,
)
from kinarm.kernels.proof import is_apart
from kinarm.kernels.session import Alone, Block

PROJECTIONS = 3
"""Largest number of projections, each of the one before."""

TRIED = -1.0
"""Distance of a projection that has been tried, or not been made."""

KEPT = 1e-3
"""Distance that a projected step keeps [m]."""

DIFFERENCE = 1e-6
"""Move of a joint for the slope of a height [rad or m]."""

ROUNDING = 1e-12
"""Move of a joint that counts as none [rad or m]."""

WARNING = 0.2
"""Time in which moving bodies go on, and the arm, where it is then, stays free of them [s]."""

MOST_STEPS = 500
"""Steps after which joints that do not rest are not looked at further."""


@inlined
def is_stuck(e: int, episodes: Episodes) -> bool:
    """Whether nothing is left that may replace an episode's step."""
    return episodes.attempt[e] > 0 and episodes.tried[e] == math.inf


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
    action, target = as_numbers(block.action), as_numbers(block.target)
    # Where the step begins: the joints, or what they were last told.
    begun, lags = as_numbers(block.q), block.plant.shape[0] > 0
    if lags:
        begun = as_numbers(block.drive)
    n_actuated, pair = rules.step_limit.shape[0], episodes.touched[e] - 1
    projected, step = episodes.projected[e], alone.step[0]
    for axis in range(n_actuated):
        start = begun[COMMAND, axis, lane]
        moved = start + action[0, axis, lane] * rules.step_limit[axis]
        step[axis] = min(max(moved, chain.lower[axis]), chain.upper[axis]) - start
    if projected[n_actuated] == TRIED:
        projected[n_actuated] = math.inf
        if not lags and pair >= 0 and projected[n_actuated + 1] < PROJECTIONS:
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
        moved = start = begun[COMMAND, axis, lane]
        if chosen >= 0:
            moved += rules.shield[chosen, axis] * step[axis]
        elif projects:
            moved = projected[axis]
        if lags:
            action[0, axis, lane] = (moved - start) / rules.step_limit[axis]
        else:
            target[0, axis, lane] = min(max(moved, chain.lower[axis]), chain.upper[axis])
    episodes.tried[e] = max(episodes.tried[e], nearest)
    if projects:
        projected[n_actuated] = TRIED
        if block.holds.shape[0] > 0:
            # It leaves a body that comes, perhaps not as far as wanted.
            as_numbers(block.holds)[0, lane] = 1.0
    elif chosen < 0 and block.holds.shape[0] > 0:
        as_numbers(block.holds)[0, lane] = 1.0
    elif chosen < 0:
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
    wanted = KEPT + approach(lane, pair, shapes, rules, block, alone)
    pushed, off = max(wanted - ahead, 0.0) / squares, 0.0
    for axis in range(n_actuated):
        start, limit = q[0, axis, lane], rules.step_limit[axis]
        moved = target[0, axis, lane] + pushed * alone.slopes[0, axis]
        moved = min(max(moved, start - limit), start + limit)
        projected[axis] = min(max(moved, chain.lower[axis]), chain.upper[axis])
        left = projected[axis] - start - alone.step[0, axis]
        off += left * left
    projected[n_actuated] = off


@inlined
def approach(
    lane: int, pair: int, shapes: ContactShapes, rules: Rules, block: Block, alone: Alone
) -> float:
    """How far a body that moves comes in `WARNING` seconds along its plane's normal, or 0 [m]."""
    frame, plane, way = shapes.planes[pair, 4], alone.plane, 0.0
    normal = rotated(alone.before, frame, plane[0, 0], plane[0, 1], plane[0, 2])
    step = int(as_numbers(block.steps)[0, lane]) + 1
    for k in range(shapes.moving.shape[0]):
        if moving_frame(shapes, k, alone.before) == frame:
            for i in range(3):
                way += normal[i] * (rules.moves[step, k, i] - rules.moves[step - 1, k, i])
    return max(way * WARNING / rules.time_step, 0.0)


@inlined
def take_down(lane: int, e: int, episodes: Episodes, block: Block) -> None:
    """Count a step that was replaced, and note which pair would have touched."""
    episodes.interventions[e] += 1
    if episodes.replaced.shape[0] > 0:
        step = int(as_numbers(block.steps)[0, lane]) - 1
        episodes.replaced[e, step] = episodes.blocker[e]
    episodes.attempt[e] = 0
    as_numbers(block.attempt)[0, lane] = 0.0
    if block.holds.shape[0] > 0:
        as_numbers(block.holds)[0, lane] = 0.0


@inlined
def held_at_rest(block: Block) -> int:
    """Bits of lanes whose arm holds its command and does not move."""
    still = block.holds[0] > 0.0
    for joint in range(block.q.shape[1]):
        still = still & (abs(block.target[0, joint] - block.q[0, joint]) <= ROUNDING)
    return lane_bits(still)


@helper
def unsafe_stops(
    asked: int,
    row: Array,
    poses: Array,
    chain: Chain,
    shapes: ContactShapes,
    rules: Rules,
    episodes: Episodes,
    block: Block,
    ahead: Block,
    alone: Alone,
) -> int:
    """Bits of lanes, of those ``asked``, whose arm is not proven to stay free after its step.

    It holds its command until its joints rest, or moving bodies have gone on for `WARNING`
    seconds. Takes the poses at the target; ``ahead`` is work space.
    """
    n_actuated, warned = rules.step_limit.shape[0], 0.0
    if shapes.moving.shape[0] > 0:
        warned = math.ceil(WARNING / rules.time_step)
    for joint in range(block.q.shape[1]):
        ahead.q[0, joint] = ahead.target[0, joint] = block.target[0, joint]
    for pair in range(block.planes.shape[0]):
        for i in range(block.planes.shape[1]):
            ahead.planes[pair, i] = block.planes[pair, i]
    for k in range(block.drive.shape[0]):
        for axis in range(n_actuated):
            ahead.drive[k, axis] = block.drive[k, axis]
    if block.plant.shape[0] > 0:
        for i in range(block.plant.shape[1]):
            ahead.plant[0, i] = block.plant[0, i]
    before, after = ahead.before, ahead.after
    for frame in range(poses.shape[0] - shapes.placed.shape[0], poses.shape[0]):
        for i in range(poses.shape[1]):
            before[frame, i] = after[frame, i] = poses[frame, i]
    ahead.holds[0] = ahead.alive[0] = 0.0 * block.q[0, 0] + 1.0
    unsafe, waiting, passed = 0, asked, 0.0
    while True:
        waiting &= ~lane_bits(comes_to_rest(passed, warned, chain, shapes, rules, ahead))
        if waiting == 0:
            return unsafe
        if passed >= MOST_STEPS:
            return unsafe | waiting
        passed += 1.0
        if ahead.plant.shape[0] > 0:
            move_joints(chain, rules, ahead.alive[0] > 0.0, ahead)
        before, after = after, before
        forward_kinematics(chain, ahead.target, 0, after)
        if shapes.moving.shape[0] > 0:
            for lane in range(LANES):
                if waiting >> lane & 1:
                    step, scenes = int(as_numbers(block.steps)[0, lane]) + 1, episodes.scenes
                    gone = min(passed, warned)
                    move_bodies(row[lane], step, lane, shapes, rules, scenes, after, gone)
        for lane in range(LANES):
            as_numbers(ahead.alive)[0, lane] = 1.0 if waiting >> lane & 1 else 0.0
        given = row, before, after, chain, shapes, rules, episodes
        found = doubtful_steps(ahead.alive[0] > 0.0, passed == 1.0, *given, ahead, alone)
        unsafe, waiting = unsafe | found, waiting & ~found
        for joint in range(ahead.q.shape[1]):
            ahead.q[0, joint] = ahead.target[0, joint]


@inlined
def comes_to_rest(
    passed: float, warned: float, chain: Chain, shapes: ContactShapes, rules: Rules, ahead: Block
) -> bool:
    """Whether arms that hold their command stay free from now on, on any way to rest.

    Where no limit acts from now on, v^2 + (rate e)^2 never rises, for the velocity v and the error
    e of a servo: a joint goes no farther than |e| plus the root of it, divided by the rate.
    """
    n_actuated, plant = rules.step_limit.shape[0], ahead.plant
    calm = 0.0 * ahead.q[0, 0] + passed >= warned
    for axis in range(n_actuated):
        ahead.action[0, axis] = 0.0 * ahead.q[0, 0]
        if plant.shape[0] > 0:
            q, velocity, rate = ahead.q[0, axis], ahead.drive[VELOCITY, axis], plant[0, RATE]
            told = ahead.drive[COMMAND, axis] + plant[0, OFFSETS + n_actuated + axis]
            reached = q == min(max(told, chain.lower[axis]), chain.upper[axis])
            error = select(reached & (velocity == 0.0), 0.0, q - told)
            swing = math.sqrt(velocity * velocity + rate * rate * error * error)
            fastest = rules.step_limit[axis] / rules.time_step
            calm = calm & (swing <= min(plant[0, STEADY], fastest))
            calm = calm & (abs(ahead.drive[CHANGE, axis]) <= plant[0, STEADY])
            calm = calm & (plant[0, DELAY] <= passed + 1.0)
            # How far it may still go.
            ahead.action[0, axis] = abs(error) + swing / rate
    for pair in range(shapes.planes.shape[0]):
        left = ahead.planes[pair, GAP]
        for axis in range(shapes.planes[pair, 2], shapes.planes[pair, 3]):
            left = left - shapes.travel[axis, pair] * ahead.action[0, axis]
        calm = calm & is_apart(left)
    return calm
