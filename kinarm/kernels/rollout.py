"""The kernels that Python calls: whole episodes, their beginning, and single configurations.

What an episode's numbers depend on is nothing but its inputs. A step that is not proven free of
contact pauses the episode until Coal has judged it.
"""

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.collision import ContactShapes
from kinarm.episodes import COLLISION, PAUSED, RUNNING, SUCCESS, TRUNCATED, Control, Episodes, Rules
from kinarm.kernels.compiling import Array, kernel
from kinarm.kernels.distance import clearance
from kinarm.kernels.kinematics import POSE, forward_kinematics, to_world
from kinarm.kernels.network import act
from kinarm.kernels.observing import observe
from kinarm.kernels.proof import is_apart, prove_step, spend_slack
from kinarm.kernels.reward import add_reward

LAYOUT = "44fabd71a0a3"
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
    """Advance the running episodes among ``first`` to ``last - 1``.

    Each goes on until it ends, reaches its ``stop`` or pauses before a step that is not proven
    free of contact.
    """
    prismatic, translation, rotation, axes, tool, lower, upper = chain[:7]
    layers, actions = control.layers, control.actions
    status, steps, stop, q, target, doubt, cleared, slack, goal, observation, distance = episodes[
        :11
    ]
    terms, total, moments, shift, path = episodes[11:]
    step_limit, travel = rules.step_limit, shapes.travel
    n_joints, n_actuated, n_observations = q.shape[1], step_limit.shape[0], observation.shape[1]
    poses, between = np.empty((n_joints + 1, POSE)), np.empty((n_joints + 1, POSE))
    motion, middle = np.empty(slack.shape[1]), np.empty((1, n_joints))
    listed = np.empty((2, slack.shape[1] + 1), dtype=np.int64)
    widest = n_observations
    for layer in range(layers.shape[0]):
        widest = max(widest, layers[layer])
    hidden, action = np.empty((3, widest)), np.empty(n_actuated)
    for e in range(first, last):
        while status[e] == RUNNING and steps[e] < stop[e]:
            if not cleared[e]:
                if layers.shape[0] > 0:
                    act(control, observation, e, hidden, action)
                else:
                    column = steps[e] if actions.shape[1] > 1 else 0
                    for axis in range(n_actuated):
                        action[axis] = min(max(actions[e, column, axis], -1.0), 1.0)
                if moments.shape[0] > 0:
                    for i in range(n_observations):
                        centred = observation[e, i] - shift[i]
                        moments[e, 0, i] += centred
                        moments[e, 1, i] += centred * centred
                for axis in range(n_actuated):
                    moved = q[e, axis] + action[axis] * step_limit[axis]
                    target[e, axis] = min(max(moved, lower[axis]), upper[axis])
            forward_kinematics(prismatic, translation, rotation, axes, target, e, poses)
            if not cleared[e] and spend_slack(e, travel, q, target, slack, motion):
                doubt[e] = prove_step(
                    e,
                    chain,
                    shapes,
                    rules.tested,
                    q,
                    target,
                    slack,
                    motion,
                    poses,
                    between,
                    middle,
                    listed,
                )
                if doubt[e] != 0:
                    status[e] = PAUSED
                    break
            cleared[e] = False
            before = distance[e]
            after = observe(tool, poses, goal, e, observation)
            distance[e] = after
            steps[e] += 1
            reached = after <= rules.tolerance
            add_reward(rules.reward, before, after, False, reached, terms, total, e)
            if reached:
                status[e] = SUCCESS
            elif steps[e] >= rules.horizon:
                status[e] = TRUNCATED
            for axis in range(n_joints):
                q[e, axis] = target[e, axis]
                if path.shape[0] > 0:
                    path[e, steps[e], axis] = q[e, axis]


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
