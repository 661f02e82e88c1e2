"""A block of episodes, side by side in lanes, and how episodes get into it and out again."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.contact_shapes import PLANE
from kinarm.episodes import Control, Episodes
from kinarm.kernels.compiling import Array, inlined, unit
from kinarm.kernels.kinematics import POSE
from kinarm.kernels.lanes import LANES, as_lanes


class Block(NamedTuple):
    """Work space of a block of episodes.

    Kernels have it twice: as arrays of lanes of the shapes below, and as the numbers behind them,
    whose arrays have one axis more, that of the episodes.

    Attributes
    ----------
    q, target : (1, n_joints)
        Configuration, and where the step leads [rad or m].
    goal : (1, 3)
        Goal position [m].
    observation, seen : (1, n_observations)
        Observation, and as a mirrored network sees it.
    poses, spare : (n_joints + 1, POSE)
        Forward kinematics at the target, and before the step.
    planes : (n_pairs + 1, PLANE)
        Separating plane of each pair, and the height above it; see `kinarm.kernels.planes`. The
        last row is work space.
    before, bend, bound : (n_pairs,)
        Height before the step, its bend, and the bound that follows [m].
    turned : (n_actuated + 1,)
        How far the first axes move in all in the step [rad or m].
    action : (1, n_actuated)
        Fractions of the step limits.
    hidden : (2, widest layer)
        Layers of networks.
    weights : (n_parameters,) or (0,)
        Parameters, if every episode has a network of its own.
    distance, total, steps, stop : (1,)
        Distance to the goal [m], return, steps taken, and step at which to hand back.
    alive, judged : (1,)
        1 where there is an episode, and where its step under way was judged already; else 0.
    terms : (1, n_terms)
        Weighted terms of the last reward.
    first, second : (n_observations,) or (0,)
        Sums of the observations acted upon, less the shift, and of their squares.
    """

    q: Array
    target: Array
    goal: Array
    observation: Array
    seen: Array
    poses: Array
    spare: Array
    planes: Array
    before: Array
    bend: Array
    bound: Array
    turned: Array
    action: Array
    hidden: Array
    weights: Array
    distance: Array
    total: Array
    steps: Array
    stop: Array
    alive: Array
    judged: Array
    terms: Array
    first: Array
    second: Array


class Alone(NamedTuple):
    """Work space for a single episode of a block.

    Attributes
    ----------
    q : (1, n_joints)
        A configuration [rad or m].
    before, after : (n_joints + 1, POSE)
        Forward kinematics before the step or between, and after it.
    plane : (1, PLANE)
        Separating plane of a pair.
    relative, simplex : (4, 3)
        See `kinarm.kernels.separation.separate`.
    listed : ndarray of int, shape (n_pairs + 1, 2)
        Pairs that are in question, and at which configurations.
    seen, hidden, action
        As in a block, for a network too large to be laid out in lanes.
    """

    q: Array
    before: Array
    after: Array
    plane: Array
    relative: Array
    simplex: Array
    listed: NDArray[np.int64]
    seen: Array
    hidden: Array
    action: Array


@unit
def work_space(
    n_joints: int, n_actuated: int, n_observations: int, n_pairs: int, n_terms: int,
    widest: int, own: int, summed: int,
) -> tuple[Block, Block, Alone]:
    """Allocate a block as numbers and as lanes, and the space for a single episode."""
    numbers = Block(
        q=np.zeros((1, n_joints, LANES)),
        target=np.zeros((1, n_joints, LANES)),
        goal=np.zeros((1, 3, LANES)),
        observation=np.zeros((1, n_observations, LANES)),
        seen=np.zeros((1, n_observations, LANES)),
        poses=np.zeros((n_joints + 1, POSE, LANES)),
        spare=np.zeros((n_joints + 1, POSE, LANES)),
        planes=np.zeros((n_pairs + 1, PLANE, LANES)),
        before=np.zeros((n_pairs, LANES)),
        bend=np.zeros((n_pairs, LANES)),
        bound=np.zeros((n_pairs, LANES)),
        turned=np.zeros((n_actuated + 1, LANES)),
        action=np.zeros((1, n_actuated, LANES)),
        hidden=np.zeros((2, widest, LANES)),
        weights=np.zeros((own, LANES)),
        distance=np.zeros((1, LANES)),
        total=np.zeros((1, LANES)),
        steps=np.zeros((1, LANES)),
        stop=np.zeros((1, LANES)),
        alive=np.zeros((1, LANES)),
        judged=np.zeros((1, LANES)),
        terms=np.zeros((1, n_terms, LANES)),
        first=np.zeros((summed, LANES)),
        second=np.zeros((summed, LANES)),
    )
    block = Block(
        q=as_lanes(numbers.q),
        target=as_lanes(numbers.target),
        goal=as_lanes(numbers.goal),
        observation=as_lanes(numbers.observation),
        seen=as_lanes(numbers.seen),
        poses=as_lanes(numbers.poses),
        spare=as_lanes(numbers.spare),
        planes=as_lanes(numbers.planes),
        before=as_lanes(numbers.before),
        bend=as_lanes(numbers.bend),
        bound=as_lanes(numbers.bound),
        turned=as_lanes(numbers.turned),
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
    )
    alone = Alone(
        q=np.zeros((1, n_joints)),
        before=np.zeros((n_joints + 1, POSE)),
        after=np.zeros((n_joints + 1, POSE)),
        plane=np.zeros((1, PLANE)),
        relative=np.zeros((4, 3)),
        simplex=np.zeros((4, 3)),
        listed=np.zeros((n_pairs + 1, 2), dtype=np.int64),
        seen=np.zeros((1, n_observations)),
        hidden=np.zeros((2, widest)),
        action=np.zeros((1, n_actuated)),
    )
    return numbers, block, alone


@inlined
def take_in(e: int, lane: int, control: Control, episodes: Episodes, numbers: Block) -> None:
    """Put an episode into a lane."""
    for joint in range(numbers.q.shape[1]):
        numbers.q[0, joint, lane] = episodes.q[e, joint]
        numbers.target[0, joint, lane] = episodes.target[e, joint]
    for i in range(3):
        numbers.goal[0, i, lane] = episodes.goal[e, i]
    for i in range(numbers.observation.shape[1]):
        numbers.observation[0, i, lane] = episodes.observation[e, i]
    for pair in range(episodes.planes.shape[1]):
        for i in range(PLANE):
            numbers.planes[pair, i, lane] = episodes.planes[e, pair, i]
    for i in range(numbers.weights.shape[0]):
        numbers.weights[i, lane] = control.weights[control.policy[e], i]
    for i in range(numbers.first.shape[0]):
        numbers.first[i, lane] = episodes.moments[e, 0, i]
        numbers.second[i, lane] = episodes.moments[e, 1, i]
    numbers.distance[0, lane] = episodes.distance[e]
    numbers.total[0, lane] = episodes.total[e]
    numbers.steps[0, lane] = episodes.steps[e]
    numbers.stop[0, lane] = episodes.stop[e]
    numbers.judged[0, lane] = 1.0 if episodes.cleared[e] else 0.0
    numbers.alive[0, lane] = 1.0


@inlined
def put_back(lane: int, e: int, episodes: Episodes, numbers: Block) -> None:
    """Hand an episode back from a lane, which is then free."""
    for joint in range(numbers.q.shape[1]):
        episodes.q[e, joint] = numbers.q[0, joint, lane]
        episodes.target[e, joint] = numbers.target[0, joint, lane]
    for i in range(numbers.observation.shape[1]):
        episodes.observation[e, i] = numbers.observation[0, i, lane]
    for pair in range(episodes.planes.shape[1]):
        for i in range(PLANE):
            episodes.planes[e, pair, i] = numbers.planes[pair, i, lane]
    for i in range(numbers.first.shape[0]):
        episodes.moments[e, 0, i] = numbers.first[i, lane]
        episodes.moments[e, 1, i] = numbers.second[i, lane]
    for term in range(numbers.terms.shape[1]):
        episodes.terms[e, term] = numbers.terms[0, term, lane]
    episodes.distance[e] = numbers.distance[0, lane]
    episodes.total[e] = numbers.total[0, lane]
    episodes.steps[e] = int(numbers.steps[0, lane])
    episodes.cleared[e] = False
    numbers.alive[0, lane] = 0.0
