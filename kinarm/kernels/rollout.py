"""Kernels of rollouts: the beginning of episodes, whole episodes, and results.

Numbers of an episode depend on its inputs alone. A step that is not proven free pauses the episode
until Coal has decided.
"""

import numpy as np
from numpy.typing import NDArray

from kinarm.episodes import COLLISION, PAUSED, RUNNING, SUCCESS, TRUNCATED, Episodes, Rules
from kinarm.kernels.block_proof import doubtful_steps
from kinarm.kernels.compiling import Array, call_stage, inlined, lean_kernel
from kinarm.kernels.goals import arrive, measure, put_goal
from kinarm.kernels.kinematics import forward_kinematics
from kinarm.kernels.lane_copies import copy_rows, move_bodies, put, put_scene, take, take_rows
from kinarm.kernels.lanes import LANES, any_lane, as_numbers, lane_bits, select
from kinarm.kernels.network import choose_actions, shared_policy
from kinarm.kernels.planes import GAP
from kinarm.kernels.plant import COMMAND, move_joints, rest, sense
from kinarm.kernels.reward import ROTATION, add_reward, observe, remember
from kinarm.kernels.screening import prove_configurations
from kinarm.kernels.session import SHIELD, Session, load_episode, store_episode, take_number
from kinarm.kernels.shield import REFUSED, take_down, unsafe_stops


@lean_kernel
def begin(counter: NDArray[np.int64], session: Session, rows: NDArray[np.int64]) -> int:
    """Start episodes at their ``q``, ``goal`` and ``steps``; ``rows``, shape (n,), tells which.

    Returns how many pause, as not proven free. Threads may share them as in `advance`.
    """
    block, alone = session.block, session.alone
    chain, shapes, rules, episodes = session.chain, session.shapes, session.rules, session.episodes
    q, path = episodes.q, episodes.path
    distances, n_paused = as_numbers(block.distance), 0
    while True:
        start = LANES * take_number(counter)
        if start >= rows.shape[0]:
            return n_paused
        filled = min(rows.shape[0] - start, LANES)
        # Load starts and goals; the last one repeats.
        for lane in range(LANES):
            e = rows[start + min(lane, filled - 1)]
            put(q, e, block.q, 0, lane)
            put(episodes.goal, e, block.goal, 0, lane)
            as_numbers(block.steps)[0, lane] = episodes.steps[e]
            if block.plant.shape[0] > 0:
                put(episodes.plant, e, block.plant, 0, lane)
                put(episodes.drive[e], COMMAND, block.drive, COMMAND, lane)
            put_scene(episodes.scenes, e, lane, block.after)
            if episodes.scenes.shape[0] > 0:
                step = episodes.steps[e]
                move_bodies(e, step, lane, shapes, rules, episodes.scenes, block.after)
        forward_kinematics(chain, block.q, 0, block.after)
        free, _ = prove_configurations(shapes, filled, False, block, alone)
        if block.turn.shape[0] > 0:
            pursuit = episodes.pursuit
            if pursuit.goals.shape[0] > 0:
                for lane in range(filled):
                    e = rows[start + lane]
                    step, number = episodes.steps[e], pursuit.goals_reached[e]
                    put_goal(e, step, number, lane, rules.goal, pursuit.goals, block.goal)
            measure(chain, rules.goal, block.after, block)
        if block.plant.shape[0] > 0:
            sense(chain, rules, block)
        remember(block)
        for axis in range(block.action.shape[1]):
            block.action[0, axis] = 0.0
        block.distance[0] = observe(session, block.after)
        for i in range(rules.width, block.observation.shape[1]):
            block.observation[0, i] = block.observation[0, i - rules.width]
        # Store all that an episode begins with.
        for lane in range(filled):
            e = rows[start + lane]
            episodes.status[e] = RUNNING if free >> lane & 1 else PAUSED
            n_paused += 0 if free >> lane & 1 else 1
            episodes.total[e] = 0.0
            episodes.shielding[e] = 0
            if episodes.interventions.shape[0] > 0:
                episodes.interventions[e] = 0
            episodes.cleared[e] = False
            episodes.distance[e] = distances[0, lane]
            for term in range(episodes.terms.shape[1]):
                episodes.terms[e, term] = 0.0
            if block.turn.shape[0] > 0:
                pursuit = episodes.pursuit
                take(block.goal, 0, lane, episodes.goal, e)
                take(block.reached, 0, lane, pursuit.reached, e)
                pursuit.turn[e], pursuit.held[e] = as_numbers(block.turn)[0, lane], 0
                if pursuit.path.shape[0] > 0:
                    take(block.goal, 0, lane, pursuit.path[e], 0)
            take(block.observation, 0, lane, episodes.observation, e)
            if block.plant.shape[0] > 0:
                take(block.sensed, 0, lane, episodes.sensed, e)
            take_rows(block.planes, lane, episodes.planes[e])
            if path.shape[0] > 0:
                take(block.q, 0, lane, path[e], 0)


@lean_kernel
def advance(counter: NDArray[np.int64], session: Session) -> int:
    """Advance the running episodes, a block at a time; return how many paused.

    Each goes on until it ends, reaches its ``stop`` or pauses before a step that is proven neither
    free nor to touch; then the next one takes its lane. Threads with own sessions may share them:
    the first counter, zero at first, numbers the next episode.
    """
    chain, shapes, rules = session.chain, session.shapes, session.rules
    control, episodes = session.control, session.episodes
    block, row, lower, upper = session.block, session.block.row, chain.lower, chain.upper
    shielded, looks = rules.shield.shape[0] > 0, block.holds.shape[0] > 0
    n_actuated = rules.step_limit.shape[0]
    n_episodes, n_pairs = episodes.status.shape[0], shapes.travel.shape[1]
    shared, summed = shared_policy(n_episodes, control), block.moments.shape[1]
    before, poses = block.before, block.after
    for lane in range(LANES):
        row[lane] = -1
    waiting, n_alive, n_paused, changed = 0, 0, 0, True
    while True:
        # Fill the lanes that are empty.
        for lane in range(row.shape[0]):
            if row[lane] < 0 and waiting < n_episodes:
                waiting = next_waiting(counter, episodes)
                if waiting < n_episodes:
                    row[lane] = waiting
                    load_episode(waiting, lane, shapes, rules, control, episodes, block)
                    n_alive += 1
                    changed = True
        if n_alive == 0:
            return n_paused
        # Act, unless Coal has found the step under way free.
        choose_actions(shared, row, session)
        fresh = (block.alive[0] > 0.0) & ~(block.cleared[0] > 0.0)
        wanted = fresh & ~(block.shielding[0] > 0.0)
        for i in range(summed):
            centred = select(wanted, block.observation[0, i] - episodes.shift[i], 0.0)
            block.moments[0, i] += centred
            block.moments[1, i] += centred * centred
        if looks:
            copy_rows(block.drive, block.former_drive)
        if block.plant.shape[0] > 0:
            move_joints(chain, rules, fresh, block)
        else:
            for axis in range(n_actuated):
                moved = block.q[0, axis] + block.action[0, axis] * rules.step_limit[axis]
                moved = min(max(moved, lower[axis]), upper[axis])
                block.target[0, axis] = select(wanted, moved, block.target[0, axis])
        # Prove the steps free: together, then by new planes, then one by one.
        before, poses = poses, before
        forward_kinematics(chain, block.target, 0, poses)
        if shapes.moving.shape[0] > 0:
            for lane in range(row.shape[0]):
                if row[lane] >= 0:
                    step = int(as_numbers(block.steps)[0, lane]) + 1
                    move_bodies(row[lane], step, lane, shapes, rules, episodes.scenes, poses)
        given = row, before, poses, session, block
        doubtful = doubtful_steps(fresh, changed, -1, False, *given)
        if looks:
            # What follows from a step while its command is held has to be free, too.
            onward = lane_bits(fresh) & ~doubtful
            doubtful |= unsafe_stops(onward, -1, row, poses, session, block)
        if shielded:
            doubtful |= lane_bits(fresh & (block.shielding[0] > 0.0))
        if doubtful != 0:
            for lane in range(row.shape[0]):
                if doubtful >> lane & 1 == 0:
                    continue
                e = row[lane]
                sure = looks or episodes.touched[e] > 0 or episodes.shielding[e] > 0
                asked = (session, lane, e, before, poses)
                if shielded and sure and call_stage(session.stages[SHIELD], asked):
                    continue
                # The episode leaves the block, at its end or to wait for Coal.
                row[lane] = -1
                store_episode(lane, e, episodes, block)
                for pair in range(n_pairs):
                    # It has not moved yet.
                    episodes.planes[e, pair, GAP] = as_numbers(block.height)[pair, lane]
                n_alive -= 1
                pair = episodes.touched[e]
                if pair > 0:
                    refuse_step(e, rules, episodes)
                else:
                    episodes.status[e] = PAUSED
                    n_paused += 1
            if n_alive == 0:
                continue
        # Move the others, observe, and reward.
        changed = False
        block.cleared[0] = 0.0
        nearer = block.distance[0]
        block.steps[0] += 1.0
        if any_lane(block.shielding[0] > 0.0):
            for lane in range(row.shape[0]):
                if row[lane] >= 0 and episodes.shielding[row[lane]] > 0:
                    take_down(lane, row[lane], episodes, block)
        remember(block)
        copy_rows(block.target, block.q)
        if block.turn.shape[0] > 0:
            reached = arrive(chain, rules, poses, row, episodes, block)
        if block.plant.shape[0] > 0:
            sense(chain, rules, block)
        after = observe(session, poses)
        if block.turn.shape[0] == 0:
            block.distance[0] = after
            reached, never = after <= rules.tolerance, after < 0.0
            add_reward(rules.reward, nearer, after, never, reached, block.terms, block.total, 0)
        if episodes.path.shape[0] > 0:
            for lane in range(row.shape[0]):
                if row[lane] >= 0:
                    step = int(as_numbers(block.steps)[0, lane])
                    take(block.q, 0, lane, episodes.path[row[lane]], step)
                    if block.turn.shape[0] > 0 and episodes.pursuit.path.shape[0] > 0:
                        take(block.goal, 0, lane, episodes.pursuit.path[row[lane]], step)
        # Take out what has ended or is to be handed back.
        late = block.steps[0] >= rules.horizon
        finished = lane_bits((block.steps[0] >= block.stop[0]) | reached | late)
        if finished != 0:
            successes, ends = lane_bits(reached), lane_bits(late)
            for lane in range(row.shape[0]):
                if finished >> lane & 1 and row[lane] >= 0:
                    e, row[lane] = row[lane], -1
                    store_episode(lane, e, episodes, block)
                    n_alive -= 1
                    if successes >> lane & 1:
                        episodes.status[e] = SUCCESS
                    elif ends >> lane & 1:
                        episodes.status[e] = TRUNCATED


@inlined
def next_waiting(counter: NDArray[np.int64], episodes: Episodes) -> int:
    """Next episode to be advanced; past the last one if there is none."""
    while True:
        e = take_number(counter)
        if e >= episodes.status.shape[0]:
            return e
        if episodes.status[e] == RUNNING and episodes.steps[e] < episodes.stop[e]:
            return e


@lean_kernel
def allow_one_step(session: Session) -> bool:
    """Let episodes go on by one step; return whether all actions are finite."""
    steps, stop, actions = session.episodes.steps, session.episodes.stop, session.control.actions
    nothing = 0.0
    for e in range(steps.shape[0]):
        stop[e] = steps[e] + 1
        for axis in range(actions.shape[2]):
            nothing += 0.0 * actions[e, 0, axis]
    return nothing == 0.0


@lean_kernel
def results_of_step(
    session: Session, numbers: Array, flags: NDArray[np.bool_], contact: NDArray[np.int64]
) -> None:
    """Read a step's results into the tables of `kinarm.simulator.StepResult`."""
    episodes = session.episodes
    for e in range(contact.shape[0]):
        stepped = episodes.steps[e] == episodes.stop[e]
        reward = 0.0
        first = numbers.shape[0] - episodes.terms.shape[1]
        for term in range(episodes.terms.shape[1]):
            part = episodes.terms[e, term] if stepped else 0.0
            numbers[first + term, e] = part
            reward += part
        if session.block.turn.shape[0] > 0:
            if session.rules.goal.kind > 0:
                numbers[2, e] = episodes.pursuit.turn[e]
            if session.rules.goal.sequence > 1:
                numbers[first - 1, e] = episodes.pursuit.goals_reached[e]
        numbers[0, e] = reward
        numbers[1, e] = episodes.distance[e]
        refused = stepped and episodes.status[e] == COLLISION
        flags[0, e] = stepped and episodes.status[e] == TRUNCATED
        flags[1, e] = stepped and episodes.status[e] == SUCCESS
        flags[2, e] = refused
        contact[e] = episodes.touched[e] if refused else 0


@lean_kernel
def refuse(rows: NDArray[np.int64], session: Session) -> None:
    """End episodes whose step Coal found to touch, or let a shield replace it."""
    rules, episodes = session.rules, session.episodes
    for index in range(rows.shape[0]):
        if rules.shield.shape[0] > 0 and episodes.shielding[rows[index]] == 0:
            episodes.shielding[rows[index]] = REFUSED
        else:
            refuse_step(rows[index], rules, episodes)


@inlined
def refuse_step(e: int, rules: Rules, episodes: Episodes) -> None:
    """End an episode whose step touches something; the arm stays."""
    episodes.status[e] = COLLISION
    episodes.steps[e] += 1
    if episodes.drive.shape[0] > 0:
        rest(e, episodes)
    distance = episodes.distance[e]
    if rules.reward.shape[0] > ROTATION:
        episodes.terms[e, ROTATION] = 0.0
    add_reward(rules.reward, distance, distance, True, False, episodes.terms, episodes.total, e)
    if episodes.path.shape[0] > 0:
        for joint in range(episodes.q.shape[1]):
            episodes.path[e, episodes.steps[e], joint] = episodes.q[e, joint]
    if episodes.pursuit.path.shape[0] > 0:
        for i in range(episodes.goal.shape[1]):
            episodes.pursuit.path[e, episodes.steps[e], i] = episodes.goal[e, i]
