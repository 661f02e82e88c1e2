"""The shield: a step that touches is replaced by the nearest one that is proven free.

Shares of it are tried, joint by joint, in the order of their distance from it, and among them its
projection off the plane between the bodies that touch. At last the arm rests.

Joints that lag go on when their command rests. So a step counts as free only if what follows from
holding its command is, too, until the joints rest: shares are those of the command's move, and at
last the command of the step before is held, which was proven then. Where bodies move, arms have to
be free of where these will be in `WARNING` seconds, if they go on as in the step.
"""

import math

from numba import types

from kinarm.contact_shapes import WITH_HALFSPACE
from kinarm.episodes import Episodes
from kinarm.kernels.block_proof import doubtful_steps
from kinarm.kernels.compiling import Array, Stage, helper, inlined
from kinarm.kernels.kinematics import forward_kinematics, rotated
from kinarm.kernels.lane_copies import (
    copy_rows,
    move_bodies,
    move_lane,
    moving_frame,
    place_between,
    spread,
    take,
)
from kinarm.kernels.lanes import LANES, as_numbers, lane_bits, select
from kinarm.kernels.planes import FINE, GAP, height_above, separate
from kinarm.kernels.plant import COMMAND, DELAY, OFFSETS, RATE, STEADY, VELOCITY, move_joints
from kinarm.kernels.proof import is_apart
from kinarm.kernels.session import Session
from kinarm.kernels.work_space import POSES, Block

REFUSED, REPLACED = 1, 2
"""States of a step that is to be replaced, as Coal refuses it, and of one that is (`Episodes`)."""

PROJECTIONS = 3
"""Largest number of projections, each of the one before."""

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


def _replace_step(session: Session, lane: int, e: int, before: Array, poses: Array) -> int:
    """Replace a step of an episode that touches; 1 if that leaves it free, else 0.

    What may replace it is tried in the order of its distance from the step, in all lanes of
    ``tries`` at once. Poses are ``before`` the step and at the target.
    """
    chain, shapes, rules, episodes = session.chain, session.shapes, session.rules, session.episodes
    block, tries, alone = session.block, session.tries, session.alone
    pair, lags, looks = episodes.touched[e], block.plant.shape[0] > 0, block.holds.shape[0] > 0
    episodes.blocker[e] = pair if pair > 0 else -1
    episodes.shielding[e] = as_numbers(block.shielding)[0, lane] = REPLACED
    for place in range(LANES):
        tries.row[place] = e
    for k in range(alone.suspected.shape[0]):
        alone.suspected[k] = 0
    # Where the step begins: the joints, or what they were last told.
    begun = as_numbers(block.q)
    if lags:
        begun = as_numbers(block.former_drive)
    list_shares(lane, begun, session)
    source, there, last, left = block, poses, lane, alone.shares.shape[0]
    n_projections, tried, nearest = 0, 0.0, math.inf
    while True:
        if not lags and last >= 0 and pair > 0 and n_projections < PROJECTIONS:
            n_projections += 1
            nearest = project_step(last, pair - 1, there, source, session)
        begin_tries(lane, before, poses, session)
        # Fill lanes, up to a projection or at last rest.
        count, last, tries.alive[0] = 0, -1, 0.0
        while count < LANES and last < 0:
            while left > 0 and alone.off[alone.shares[0]] <= tried:
                left -= 1
                alone.shares[0] = alone.shares[left]
                sink(0, left, session)
            chosen, off = -1, nearest
            if left > 0 and alone.off[alone.shares[0]] < off:
                chosen, off = alone.shares[0], alone.off[alone.shares[0]]
            put_try(count, lane, chosen, off < math.inf, begun, session)
            tried, last = max(tried, off), count if chosen < 0 else -1
            count += 1
        asked, rests = (1 << count) - 1, last >= 0 and nearest == math.inf
        named = 1 << last if last >= 0 else 0
        if lags:
            move_joints(chain, rules, tries.alive[0] > 0.0, tries)
        forward_kinematics(chain, tries.target, 0, tries.after)
        given = tries.row, tries.before, tries.after, session, tries
        found = asked & ~doubtful_steps(tries.alive[0] > 0.0, True, named, not looks, *given)
        if looks:
            onward = found & ~lane_bits(tries.holds[0] > 0.0)
            found &= ~unsafe_stops(onward, named, tries.row, tries.after, session, tries)
        if rests and shapes.moving.shape[0] == 0 and (not looks or is_still(last, tries)):
            # Where the arm rests, it is known to be free.
            found |= named
        for place in range(count):
            if found >> place & 1 or (rests and place == last):
                take_over(place, lane, poses, block, tries)
                return found >> place & 1
        source, there, pair = tries, tries.after, episodes.touched[e]
        nearest = math.inf if last >= 0 else nearest


REPLACE_STEP = Stage(_replace_step, types.int64, types.int64, POSES, POSES)


@inlined
def list_shares(lane: int, begun: Array, session: Session) -> None:
    """Fill in the step that an episode wants, and a heap of its shares, the nearest first."""
    chain, rules, block, alone = session.chain, session.rules, session.block, session.alone
    action, step = as_numbers(block.action), alone.step[0]
    for axis in range(rules.step_limit.shape[0]):
        start = begun[COMMAND, axis, lane]
        moved = start + action[0, axis, lane] * rules.step_limit[axis]
        step[axis] = min(max(moved, chain.lower[axis]), chain.upper[axis]) - start
    for k in range(rules.shield.shape[0]):
        off = 0.0
        for axis in range(rules.step_limit.shape[0]):
            left = (1.0 - rules.shield[k, axis]) * step[axis]
            off += left * left
        alone.off[k], alone.shares[k] = off, k
    for place in range(rules.shield.shape[0] // 2 - 1, -1, -1):
        sink(place, rules.shield.shape[0], session)


@inlined
def sink(place: int, count: int, session: Session) -> None:
    """Let a share sink in the heap, of the first so many, below those that come before it.

    Of equally distant ones, the first of the table comes first.
    """
    shares, off = session.alone.shares, session.alone.off
    sunk = shares[place]
    while 2 * place + 1 < count:
        below = 2 * place + 1
        if below + 1 < count:
            one, other = shares[below], shares[below + 1]
            below += (off[other], other) < (off[one], one)
        share = shares[below]
        if (off[sunk], sunk) < (off[share], share):
            break
        shares[place], place = share, below
    shares[place] = sunk


@inlined
def put_try(
    place: int, lane: int, chosen: int, moves: bool, begun: Array, session: Session
) -> None:
    """Put a share of a step into a lane; without, its projection if it ``moves``, or rest."""
    chain, rules, tries, alone = session.chain, session.rules, session.tries, session.alone
    action, target = as_numbers(tries.action), as_numbers(tries.target)
    as_numbers(tries.alive)[0, place] = 1.0
    for axis in range(rules.step_limit.shape[0]):
        moved = start = begun[COMMAND, axis, lane]
        if chosen >= 0:
            moved += rules.shield[chosen, axis] * alone.step[0, axis]
        elif moves:
            moved = alone.projected[0, axis]
        if tries.plant.shape[0] > 0:
            # A command that begins beyond a limit comes back at once.
            action[0, axis, place] = min(max((moved - start) / rules.step_limit[axis], -1.0), 1.0)
        else:
            target[0, axis, place] = min(max(moved, chain.lower[axis]), chain.upper[axis])
    if tries.holds.shape[0] > 0:
        # A projection leaves a body that comes, perhaps not as far as wanted.
        as_numbers(tries.holds)[0, place] = 1.0 if chosen < 0 else 0.0


@inlined
def begin_tries(lane: int, before: Array, poses: Array, session: Session) -> None:
    """Put what an episode's step begins with, and where bodies go, into all lanes of tries."""
    block, tries = session.block, session.tries
    spread(block.q, lane, tries.q)
    spread(block.target, lane, tries.target)
    spread(block.plant, lane, tries.plant)
    spread(block.former_drive, lane, tries.drive)
    spread(block.planes, lane, tries.planes)
    for pair in range(block.height.shape[0]):
        tries.planes[pair, GAP] = as_numbers(block.height)[pair, lane]
    tries.steps[0] = as_numbers(block.steps)[0, lane]
    for frame in range(block.q.shape[1] + 1, poses.shape[0]):
        for i in range(poses.shape[1]):
            tries.before[frame, i] = as_numbers(before)[frame, i, lane]
            tries.after[frame, i] = as_numbers(poses)[frame, i, lane]


@inlined
def take_over(place: int, lane: int, poses: Array, block: Block, tries: Block) -> None:
    """Take a try for the step of an episode."""
    move_lane(tries.target, place, block.target, lane)
    move_lane(tries.planes, place, block.planes, lane)
    move_lane(tries.after, place, poses, lane)
    for pair in range(block.height.shape[0]):
        as_numbers(block.height)[pair, lane] = as_numbers(tries.height)[pair, place]
    if block.plant.shape[0] > 0:
        move_lane(tries.drive, place, block.drive, lane)
        move_lane(tries.action, place, block.action, lane)


@inlined
def project_step(lane: int, pair: int, poses: Array, block: Block, session: Session) -> float:
    """Project the target of a lane off the plane between two bodies.

    Takes the poses there. Fills in joint positions, and returns their squared distance from the
    step that was wanted.
    """
    chain, shapes, rules, alone = session.chain, session.shapes, session.rules, session.alone
    q, target, plane = as_numbers(block.q), as_numbers(block.target), alone.plane
    n_actuated, projected = rules.step_limit.shape[0], alone.projected[0]
    # Bodies are where they are at the end of the step.
    for frame in range(block.q.shape[1] + 1, poses.shape[0]):
        take(poses, frame, lane, alone.before, frame)
        take(poses, frame, lane, alone.after, frame)
    for k in range(shapes.moving.shape[0]):
        for i in range(3):
            position = alone.after[moving_frame(shapes, k, poses), 13 + i]
            alone.moved[k, i] = alone.moved[k, 3 + i] = position
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
    wanted = KEPT + approach(lane, pair, block, session)
    pushed, off = max(wanted - ahead, 0.0) / squares, 0.0
    for axis in range(n_actuated):
        start, limit = q[0, axis, lane], rules.step_limit[axis]
        moved = target[0, axis, lane] + pushed * alone.slopes[0, axis]
        moved = min(max(moved, start - limit), start + limit)
        projected[axis] = min(max(moved, chain.lower[axis]), chain.upper[axis])
        left = projected[axis] - start - alone.step[0, axis]
        off += left * left
    return off


@inlined
def approach(lane: int, pair: int, block: Block, session: Session) -> float:
    """How far a body that moves comes in `WARNING` seconds along its plane's normal, or 0 [m]."""
    shapes, rules, alone = session.shapes, session.rules, session.alone
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
    episodes.shielding[e] = 0
    as_numbers(block.shielding)[0, lane] = 0.0


@inlined
def is_still(lane: int, block: Block) -> bool:
    """Whether an arm does not move in its step."""
    q, target, farthest = as_numbers(block.q), as_numbers(block.target), 0.0
    for joint in range(q.shape[1]):
        farthest = max(farthest, abs(target[0, joint, lane] - q[0, joint, lane]))
    return farthest <= ROUNDING


@helper
def unsafe_stops(
    asked: int, named: int, row: Array, poses: Array, session: Session, block: Block
) -> int:
    """Bits of lanes, of those ``asked``, whose arm is not proven to stay free after its step.

    It holds its command until its joints rest, or moving bodies have gone on for `WARNING`
    seconds. Takes the poses at the target, and notes which pair of ``named`` lanes touches.
    """
    chain, shapes, rules, ahead = session.chain, session.shapes, session.rules, session.ahead
    warned = math.ceil(WARNING / rules.time_step) if shapes.moving.shape[0] > 0 else 0.0
    copy_rows(block.target, ahead.q)
    copy_rows(block.target, ahead.target)
    copy_rows(block.planes, ahead.planes)
    copy_rows(block.drive, ahead.drive)
    copy_rows(block.plant, ahead.plant)
    before, after = ahead.before, ahead.after
    for frame in range(poses.shape[0] - shapes.placed.shape[0], poses.shape[0]):
        for i in range(poses.shape[1]):
            before[frame, i] = after[frame, i] = poses[frame, i]
    ahead.holds[0] = ahead.alive[0] = 0.0 * block.q[0, 0] + 1.0
    unsafe, waiting, passed = 0, asked, 0.0
    while True:
        waiting &= ~lane_bits(comes_to_rest(passed, warned, session))
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
                    step, gone = int(as_numbers(block.steps)[0, lane]) + 1, min(passed, warned)
                    scenes = session.episodes.scenes
                    move_bodies(row[lane], step, lane, shapes, rules, scenes, after, gone)
        for lane in range(LANES):
            as_numbers(ahead.alive)[0, lane] = 1.0 if waiting >> lane & 1 else 0.0
        given = named, False, row, before, after, session, ahead
        found = doubtful_steps(ahead.alive[0] > 0.0, passed == 1.0, *given)
        unsafe, waiting = unsafe | found, waiting & ~found
        copy_rows(ahead.target, ahead.q)


@inlined
def comes_to_rest(passed: float, warned: float, session: Session) -> bool:
    """Whether arms that hold their command stay free from now on, on any way to rest.

    Where no limit acts from now on, v^2 + (rate e)^2 never rises, for the velocity v and the error
    e of a servo: a joint goes no farther than |e| plus the root of it, divided by the rate.
    """
    chain, shapes, rules, ahead = session.chain, session.shapes, session.rules, session.ahead
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
            calm = calm & (plant[0, DELAY] <= passed + 1.0)
            # How far it may still go.
            ahead.action[0, axis] = abs(error) + swing / rate
    for pair in range(shapes.travel.shape[1]):
        left = ahead.planes[pair, GAP]
        for axis in range(shapes.planes[pair, 2], shapes.planes[pair, 3]):
            left = left - shapes.travel[axis, pair] * ahead.action[0, axis]
        calm = calm & is_apart(left)
    return calm
