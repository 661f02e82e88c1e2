"""The kernels that Python calls: whole episodes, their beginning, and single configurations.

What an episode's numbers depend on is nothing but its inputs. A step that is not proven free of
contact pauses the episode until Coal has judged it.
"""

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.contact_shapes import PLANE, ContactShapes
from kinarm.episodes import COLLISION, PAUSED, RUNNING, SUCCESS, TRUNCATED, Control, Episodes, Rules
from kinarm.kernels.acting import choose_actions, shared_policy
from kinarm.kernels.block import Alone, Block, put_back, take_in, work_space
from kinarm.kernels.compiling import Array, inlined, kernel
from kinarm.kernels.kinematics import forward_kinematics, to_world
from kinarm.kernels.lanes import LANES, any_lane, as_numbers, lane_bits, select
from kinarm.kernels.observing import observe
from kinarm.kernels.planes import GAP
from kinarm.kernels.proof import (
    is_apart,
    propose_planes,
    prove_alone,
    prove_step,
    renew_planes,
    stands_free,
)
from kinarm.kernels.reward import add_reward
from kinarm.kernels.session import Session

LAYOUT = "69e76db5787f"
"""Hash of what is compiled in from other files; a test tells when to renew it.

Numba's disk cache notices changes only in this file, so changing this line is what makes it
compile anew.
"""


@kernel
def screen(
    first: int,
    last: int,
    chain: Chain,
    shapes: ContactShapes,
    configurations: Array,
    tools: Array,
    proven: NDArray[np.bool_],
) -> None:
    """Find the tool points of configurations, shape (n, 3) [m], and which are proven free."""
    n_joints, tool = configurations.shape[1], chain.tool
    block, alone = work_space(n_joints, 0, 0, shapes.planes.shape[0], 0, 0, 0, 0)
    q, points = as_numbers(block.q), as_numbers(block.goal)
    for start in range(first, last, LANES):
        filled = min(last - start, LANES)
        for lane in range(LANES):
            row = start + min(lane, filled - 1)
            for joint in range(n_joints):
                q[0, joint, lane] = configurations[row, joint]
        free = stand(chain, shapes, filled, block, alone)
        x, y, z = to_world(block.after, n_joints, tool[0], tool[1], tool[2])
        block.goal[0, 0], block.goal[0, 1], block.goal[0, 2] = x, y, z
        for lane in range(filled):
            proven[start + lane] = free >> lane & 1 != 0
            for axis in range(3):
                tools[start + lane, axis] = points[0, axis, lane]


@kernel
def begin(first: int, last: int, rows: NDArray[np.int64], session: Session) -> int:
    """Start episodes ``rows[first]`` to ``rows[last - 1]`` at their ``q`` and ``goal``.

    An episode whose start is not proven contact-free is left paused; returns how many are.
    """
    chain, shapes, episodes = session.chain, session.shapes, session.episodes
    q, planes, path = episodes.q, episodes.planes, episodes.path
    n_joints, n_observations = q.shape[1], episodes.observation.shape[1]
    n_pairs = shapes.planes.shape[0]
    block, alone = work_space(n_joints, 0, n_observations, n_pairs, 0, 0, 0, 0)
    starts, goals = as_numbers(block.q), as_numbers(block.goal)
    distances, observations = as_numbers(block.distance), as_numbers(block.observation)
    proposed, n_paused = as_numbers(block.planes), 0
    for start in range(first, last, LANES):
        filled = min(last - start, LANES)
        for lane in range(LANES):
            e = rows[start + min(lane, filled - 1)]
            for joint in range(n_joints):
                starts[0, joint, lane] = q[e, joint]
            for axis in range(3):
                goals[0, axis, lane] = episodes.goal[e, axis]
        free = stand(chain, shapes, filled, block, alone)
        block.distance[0] = observe(chain.tool, block.after, block.goal, 0, block.observation)
        for lane in range(filled):
            e = rows[start + lane]
            episodes.status[e] = RUNNING if free >> lane & 1 else PAUSED
            n_paused += 0 if free >> lane & 1 else 1
            episodes.steps[e] = 0
            episodes.total[e] = 0.0
            episodes.cleared[e] = False
            episodes.distance[e] = distances[0, lane]
            for term in range(episodes.terms.shape[1]):
                episodes.terms[e, term] = 0.0
            for i in range(n_observations):
                episodes.observation[e, i] = observations[0, i, lane]
            for pair in range(n_pairs):
                for i in range(PLANE):
                    planes[e, pair, i] = proposed[pair, i, lane]
            if path.shape[0] > 0:
                for joint in range(n_joints):
                    path[e, 0, joint] = q[e, joint]
    return n_paused


@inlined
def stand(chain: Chain, shapes: ContactShapes, filled: int, block: Block, alone: Alone) -> int:
    """Place the arms of a block, and return the bits of those that are proven free of contact."""
    prismatic, translation, rotation, axes = chain[:4]
    forward_kinematics(prismatic, translation, rotation, axes, block.q, 0, block.after)
    free = lane_bits(is_apart(propose_planes(shapes, block.after, block)))
    for lane in range(filled):
        if free >> lane & 1 == 0 and stands_free(lane, shapes, block.after, block, alone):
            free |= 1 << lane
    return free


@kernel
def bind(
    chain: Chain, shapes: ContactShapes, rules: Rules, control: Control, episodes: Episodes
) -> Session:
    """Bind a session, whose arrays stay those given."""
    return Session(chain, shapes, rules, control, episodes)


@kernel
def advance(first: int, last: int, session: Session) -> int:
    """Advance the running episodes among ``first`` to ``last - 1``, a block at a time.

    Each goes on until it ends, reaches its ``stop`` or pauses before a step that is not proven
    free of contact; then the next one takes its place in the block. Returns how many paused.
    """
    chain, shapes, rules = session.chain, session.shapes, session.rules
    control, episodes = session.control, session.episodes
    prismatic, translation, rotation, axes, tool, lower, upper = chain[:7]
    n_joints, n_actuated = episodes.q.shape[1], rules.step_limit.shape[0]
    n_observations, n_pairs = episodes.observation.shape[1], shapes.planes.shape[0]
    shared = shared_policy(first, last, control)
    own = control.weights.shape[1] if shared < 0 else 0
    summed = n_observations if episodes.moments.shape[0] > 0 else 0
    widest = 1
    for layer in range(1, control.layers.shape[0]):
        widest = max(widest, control.layers[layer])
    block, alone = work_space(
        n_joints,
        n_actuated,
        n_observations,
        n_pairs,
        rules.reward.shape[0],
        widest,
        own,
        summed,
    )
    row = np.full(LANES, -1)
    before, poses = block.before, block.after
    waiting, n_alive, n_paused, changed = first, 0, 0, True
    while True:
        for lane in range(row.shape[0]):
            if row[lane] < 0 and waiting < last:
                while waiting < last and not (
                    episodes.status[waiting] == RUNNING
                    and episodes.steps[waiting] < episodes.stop[waiting]
                ):
                    waiting += 1
                if waiting < last:
                    row[lane] = waiting
                    take_in(waiting, lane, control, episodes, block)
                    waiting += 1
                    n_alive += 1
                    changed = True
        if n_alive == 0:
            return n_paused
        choose_actions(control, shared, row, block)
        fresh = (block.alive[0] > 0.0) & ~(block.judged[0] > 0.0)
        for i in range(summed):
            centred = select(fresh, block.observation[0, i] - episodes.shift[i], 0.0)
            block.first[i] += centred
            block.second[i] += centred * centred
        for axis in range(n_actuated):
            moved = block.q[0, axis] + block.action[0, axis] * rules.step_limit[axis]
            moved = min(max(moved, lower[axis]), upper[axis])
            block.target[0, axis] = select(fresh, moved, block.target[0, axis])
        before, poses = poses, before
        forward_kinematics(prismatic, translation, rotation, axes, block.target, 0, poses)
        unproven = ~is_apart(prove_step(shapes, rules.tested, poses, block)) & fresh
        if any_lane(unproven):
            if changed:
                forward_kinematics(prismatic, translation, rotation, axes, block.q, 0, before)
            least = renew_planes(shapes, rules.tested, unproven, before, poses, block)
            unproven = unproven & ~is_apart(least)
        if any_lane(unproven):
            still = lane_bits(unproven)
            for lane in range(row.shape[0]):
                if still >> lane & 1 == 0:
                    continue
                doubt = prove_alone(lane, chain, shapes, rules.tested, poses, block, alone)
                if doubt != 0:
                    e, row[lane] = row[lane], -1
                    put_back(lane, e, episodes, block)
                    for pair in range(n_pairs):
                        # It has not moved yet.
                        episodes.planes[e, pair, GAP] = as_numbers(block.height)[pair, lane]
                    episodes.doubt[e] = doubt
                    episodes.status[e] = PAUSED
                    n_alive -= 1
                    n_paused += 1
            if n_alive == 0:
                continue
        changed = False
        block.judged[0] = 0.0
        nearer = block.distance[0]
        after = observe(tool, poses, block.goal, 0, block.observation)
        block.distance[0] = after
        block.steps[0] += 1.0
        reached, never = after <= rules.tolerance, after < 0.0
        add_reward(rules.reward, nearer, after, never, reached, block.terms, block.total, 0)
        for joint in range(n_joints):
            block.q[0, joint] = block.target[0, joint]
        if episodes.path.shape[0] > 0:
            for lane in range(row.shape[0]):
                if row[lane] >= 0:
                    step = int(as_numbers(block.steps)[0, lane])
                    for joint in range(n_joints):
                        episodes.path[row[lane], step, joint] = as_numbers(block.q)[0, joint, lane]
        late = block.steps[0] >= rules.horizon
        finished = lane_bits((block.steps[0] >= block.stop[0]) | reached | late)
        if finished != 0:
            successes, ends = lane_bits(reached), lane_bits(late)
            for lane in range(row.shape[0]):
                if finished >> lane & 1 and row[lane] >= 0:
                    e, row[lane] = row[lane], -1
                    put_back(lane, e, episodes, block)
                    n_alive -= 1
                    if successes >> lane & 1:
                        episodes.status[e] = SUCCESS
                    elif ends >> lane & 1:
                        episodes.status[e] = TRUNCATED


@kernel
def allow_one_step(session: Session) -> None:
    """Let every episode go on by one step."""
    steps, stop = session.episodes.steps, session.episodes.stop
    for e in range(steps.shape[0]):
        stop[e] = steps[e] + 1


@kernel
def results_of_step(
    session: Session, reward: Array, terms: Array, ended: NDArray[np.bool_]
) -> None:
    """Read off the one step that was allowed: rewards, their terms, and how episodes ended.

    ``ended``, shape (n, 3), tells of success, contact and truncation. Of episodes that had ended
    before the step, all is zero.
    """
    episodes = session.episodes
    for e in range(reward.shape[0]):
        stepped = episodes.steps[e] == episodes.stop[e]
        reward[e] = 0.0
        for term in range(terms.shape[1]):
            terms[e, term] = episodes.terms[e, term] if stepped else 0.0
            reward[e] += terms[e, term]
        ended[e, 0] = stepped and episodes.status[e] == SUCCESS
        ended[e, 1] = stepped and episodes.status[e] == COLLISION
        ended[e, 2] = stepped and episodes.status[e] == TRUNCATED


@kernel
def refuse(rows: NDArray[np.int64], session: Session) -> None:
    """End episodes whose step touches something: the arm stays where it is."""
    rules, episodes = session.rules, session.episodes
    for index in range(rows.shape[0]):
        e = rows[index]
        episodes.status[e] = COLLISION
        episodes.steps[e] += 1
        distance = episodes.distance[e]
        add_reward(rules.reward, distance, distance, True, False, episodes.terms, episodes.total, e)
        if episodes.path.shape[0] > 0:
            for joint in range(episodes.q.shape[1]):
                episodes.path[e, episodes.steps[e], joint] = episodes.q[e, joint]
