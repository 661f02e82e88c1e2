"""The kernels that Python calls: whole episodes, their beginning, and single configurations.

What an episode's numbers depend on is nothing but its inputs. A step that is not proven free of
contact pauses the episode until Coal has judged it.
"""

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.collision import ContactShapes
from kinarm.episodes import COLLISION, PAUSED, RUNNING, SUCCESS, TRUNCATED, Control, Episodes, Rules
from kinarm.kernels.block import Block, put_back, take_in
from kinarm.kernels.compiling import Array, inlined, kernel
from kinarm.kernels.distance import clearance
from kinarm.kernels.kinematics import POSE, forward_kinematics, to_world
from kinarm.kernels.lanes import LANES, any_lane, as_lanes, lane_bits, select
from kinarm.kernels.network import act
from kinarm.kernels.observing import observe
from kinarm.kernels.proof import is_apart, prove_step, spend_slack
from kinarm.kernels.reward import add_reward

LAYOUT = "a4"
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
    prismatic, translation, rotation, axes, tool = chain[:5]
    link, capsules, boxes, pairs = shapes[:4]
    n_joints = configurations.shape[1]
    poses = np.empty((n_joints + 1, POSE))
    for i in range(first, last):
        forward_kinematics(prismatic, translation, rotation, axes, configurations, i, poses)
        tools[i, 0], tools[i, 1], tools[i, 2] = to_world(poses, n_joints, tool[0], tool[1], tool[2])
        proven[i] = True
        for pair in range(pairs.shape[0]):
            if not is_apart(clearance(pair, pairs, capsules, link, boxes, poses)):
                proven[i] = False
                break


@kernel
def begin(
    first: int,
    last: int,
    rows: NDArray[np.int64],
    chain: Chain,
    shapes: ContactShapes,
    episodes: Episodes,
) -> None:
    """Start episodes ``rows[first]`` to ``rows[last - 1]`` at their ``q`` and ``goal``.

    An episode whose start is not proven contact-free is left paused.
    """
    prismatic, translation, rotation, axes, tool = chain[:5]
    link, capsules, boxes, pairs = shapes[:4]
    q, slack, path = episodes.q, episodes.slack, episodes.path
    poses = np.empty((q.shape[1] + 1, POSE))
    for index in range(first, last):
        e = rows[index]
        forward_kinematics(prismatic, translation, rotation, axes, q, e, poses)
        distance = observe(tool, poses, episodes.goal, e, episodes.observation)
        episodes.distance[e] = distance
        episodes.steps[e] = 0
        episodes.total[e] = 0.0
        for term in range(episodes.terms.shape[1]):
            episodes.terms[e, term] = 0.0
        episodes.cleared[e] = False
        episodes.status[e] = RUNNING
        for pair in range(pairs.shape[0]):
            slack[e, pair] = clearance(pair, pairs, capsules, link, boxes, poses)
            if not is_apart(slack[e, pair]):
                episodes.status[e] = PAUSED
        for axis in range(q.shape[1]):
            if path.shape[0] > 0:
                path[e, 0, axis] = q[e, axis]


OWN_WEIGHTS = 4096
"""Networks with more parameters are not laid out in lanes, if episodes have different ones."""

SHARED, OWN, ONE_BY_ONE, TABLE = range(4)
"""Ways to choose the actions of a block."""


@kernel
def advance(
    first: int,
    last: int,
    chain: Chain,
    shapes: ContactShapes,
    rules: Rules,
    control: Control,
    episodes: Episodes,
) -> None:
    """Advance the running episodes among ``first`` to ``last - 1``, a block at a time.

    Each goes on until it ends, reaches its ``stop`` or pauses before a step that is not proven
    free of contact; then the next one takes its place in the block.
    """
    way = way_to_act(first, last, control)
    n_joints, n_actuated = episodes.q.shape[1], rules.step_limit.shape[0]
    n_observations, n_pairs = episodes.observation.shape[1], episodes.slack.shape[1]
    widest = 1
    for layer in range(1, control.layers.shape[0]):
        widest = max(widest, control.layers[layer])
    own = control.weights.shape[1] if way == OWN else 0
    summed = n_observations if episodes.moments.shape[0] > 0 else 0
    numbers = Block(
        q=np.zeros((1, n_joints, LANES)),
        target=np.zeros((1, n_joints, LANES)),
        middle=np.zeros((1, n_joints, LANES)),
        goal=np.zeros((1, 3, LANES)),
        observation=np.zeros((1, n_observations, LANES)),
        seen=np.zeros((1, n_observations, LANES)),
        slack=np.zeros((n_pairs, LANES)),
        motion=np.zeros((n_pairs, LANES)),
        poses=np.zeros((n_joints + 1, POSE, LANES)),
        between=np.zeros((n_joints + 1, POSE, LANES)),
        action=np.zeros((1, n_actuated, LANES)),
        hidden=np.zeros((2, widest, LANES)),
        weights=np.zeros((own, LANES)),
        distance=np.zeros((1, LANES)),
        total=np.zeros((1, LANES)),
        steps=np.zeros((1, LANES)),
        stop=np.zeros((1, LANES)),
        alive=np.zeros((1, LANES)),
        judged=np.zeros((1, LANES)),
        terms=np.zeros((1, rules.reward.shape[0], LANES)),
        first=np.zeros((summed, LANES)),
        second=np.zeros((summed, LANES)),
        open=np.zeros((n_pairs + 1, rules.tested), dtype=np.int64),
        doubt=np.zeros(LANES, dtype=np.int64),
        episode=np.full(LANES, -1),
    )
    block = Block(
        q=as_lanes(numbers.q),
        target=as_lanes(numbers.target),
        middle=as_lanes(numbers.middle),
        goal=as_lanes(numbers.goal),
        observation=as_lanes(numbers.observation),
        seen=as_lanes(numbers.seen),
        slack=as_lanes(numbers.slack),
        motion=as_lanes(numbers.motion),
        poses=as_lanes(numbers.poses),
        between=as_lanes(numbers.between),
        action=as_lanes(numbers.action),
        hidden=as_lanes(numbers.hidden),
        weights=as_lanes(numbers.weights),
        distance=as_lanes(numbers.distance),
        total=as_lanes(numbers.total),
        steps=as_lanes(numbers.steps),
        stop=as_lanes(numbers.stop),
        alive=as_lanes(numbers.alive),
        judged=as_lanes(numbers.judged),
        terms=as_lanes(numbers.terms),
        first=as_lanes(numbers.first),
        second=as_lanes(numbers.second),
        open=numbers.open,
        doubt=numbers.doubt,
        episode=numbers.episode,
    )
    alone, alone_hidden = np.zeros((1, n_observations)), np.zeros((2, widest))
    alone_action = np.zeros((1, n_actuated))
    prismatic, translation, rotation, axes, tool, lower, upper = chain[:7]
    waiting, n_alive, n_lanes = first, 0, numbers.episode.shape[0]
    while True:
        for lane in range(n_lanes):
            if numbers.episode[lane] < 0:
                while waiting < last and not (
                    episodes.status[waiting] == RUNNING
                    and episodes.steps[waiting] < episodes.stop[waiting]
                ):
                    waiting += 1
                if waiting < last:
                    take_in(waiting, lane, control, episodes, numbers)
                    waiting += 1
                    n_alive += 1
        if n_alive == 0:
            return
        reflected = see(control, block)
        if way == SHARED:
            weights = control.weights[control.policy[numbers.episode.max()]]
            act(
                control.layers,
                control.activations,
                weights,
                block.seen,
                block.hidden,
                block.action,
            )
        elif way == OWN:
            act(
                control.layers,
                control.activations,
                block.weights,
                block.seen,
                block.hidden,
                block.action,
            )
        else:
            for lane in range(n_lanes):
                e = numbers.episode[lane]
                if e < 0:
                    continue
                if way == ONE_BY_ONE:
                    for i in range(n_observations):
                        alone[0, i] = numbers.seen[0, i, lane]
                    act(
                        control.layers,
                        control.activations,
                        control.weights[control.policy[e]],
                        alone,
                        alone_hidden,
                        alone_action,
                    )
                    for axis in range(n_actuated):
                        numbers.action[0, axis, lane] = alone_action[0, axis]
                else:
                    column = int(numbers.steps[0, lane]) if control.actions.shape[1] > 1 else 0
                    for axis in range(n_actuated):
                        numbers.action[0, axis, lane] = control.actions[e, column, axis]
        fresh = (block.alive[0] > 0.0) & ~(block.judged[0] > 0.0)
        for i in range(summed):
            centred = select(fresh, block.observation[0, i] - episodes.shift[i], 0.0)
            block.first[i] += centred
            block.second[i] += centred * centred
        for axis in range(n_actuated):
            action = min(max(block.action[0, axis], -1.0), 1.0)
            if control.action_signs.shape[0] > 0:
                action = select(reflected, action * control.action_signs[axis], action)
            moved = block.q[0, axis] + action * rules.step_limit[axis]
            moved = min(max(moved, lower[axis]), upper[axis])
            block.target[0, axis] = select(fresh, moved, block.target[0, axis])
        forward_kinematics(prismatic, translation, rotation, axes, block.target, 0, block.poses)
        spent = spend_slack(shapes.travel, block) & fresh
        if any_lane(spent):
            doubtful = prove_step(chain, shapes, rules.tested, spent, block)
            if doubtful != 0:
                for lane in range(n_lanes):
                    if doubtful >> lane & 1:
                        e = put_back(lane, episodes, numbers)
                        episodes.doubt[e] = numbers.doubt[lane]
                        episodes.status[e] = PAUSED
                        numbers.doubt[lane] = 0
                        n_alive -= 1
                if n_alive == 0:
                    continue
        block.judged[0] = 0.0
        before = block.distance[0]
        after = observe(tool, block.poses, block.goal, 0, block.observation)
        block.distance[0] = after
        block.steps[0] += 1.0
        reached = after <= rules.tolerance
        never = after < 0.0
        add_reward(rules.reward, before, after, never, reached, block.terms, block.total, 0)
        for joint in range(n_joints):
            block.q[0, joint] = block.target[0, joint]
        if episodes.path.shape[0] > 0:
            for lane in range(n_lanes):
                e = numbers.episode[lane]
                if e >= 0:
                    step = int(numbers.steps[0, lane])
                    for joint in range(n_joints):
                        episodes.path[e, step, joint] = numbers.q[0, joint, lane]
        late = block.steps[0] >= rules.horizon
        stopped = (block.steps[0] >= block.stop[0]) | reached | late
        finished = lane_bits(stopped & (block.alive[0] > 0.0))
        if finished != 0:
            successes, ends = lane_bits(reached), lane_bits(late)
            for lane in range(n_lanes):
                if finished >> lane & 1:
                    e = put_back(lane, episodes, numbers)
                    n_alive -= 1
                    if successes >> lane & 1:
                        episodes.status[e] = SUCCESS
                    elif ends >> lane & 1:
                        episodes.status[e] = TRUNCATED


@inlined
def way_to_act(first: int, last: int, control: Control) -> int:
    """How the episodes of a range get their actions."""
    if control.layers.shape[0] == 0:
        return TABLE
    for e in range(first + 1, last):
        if control.policy[e] != control.policy[first]:
            return OWN if control.weights.shape[1] <= OWN_WEIGHTS else ONE_BY_ONE
    return SHARED


@inlined
def see(control: Control, block: Block) -> bool:
    """Fill in what the networks see; returns where they see it in the mirror.

    A network with a mirror has learnt goals on the right alone: for a goal on the left it is
    given the reflected observation, and its action is reflected in turn.
    """
    signs = control.observation_signs
    reflected = block.observation[0, control.side] > 0.0
    for i in range(block.observation.shape[1]):
        given = block.observation[0, i]
        if signs.shape[0] > 0:
            block.seen[0, i] = select(reflected, signs[i] * given, given)
        else:
            block.seen[0, i] = given
    return reflected


@kernel
def refuse(rows: NDArray[np.int64], rules: Rules, episodes: Episodes) -> None:
    """End episodes whose step touches something: the arm stays where it is."""
    for index in range(rows.shape[0]):
        e = rows[index]
        episodes.status[e] = COLLISION
        episodes.steps[e] += 1
        distance = episodes.distance[e]
        add_reward(rules.reward, distance, distance, True, False, episodes.terms, episodes.total, e)
        if episodes.path.shape[0] > 0:
            for joint in range(episodes.q.shape[1]):
                episodes.path[e, episodes.steps[e], joint] = episodes.q[e, joint]
