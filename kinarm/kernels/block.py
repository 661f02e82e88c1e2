"""A block of episodes, side by side in lanes, and how episodes get into it and out again."""

from functools import cache
from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from kinarm.contact_shapes import PLANE
from kinarm.episodes import Control, Episodes
from kinarm.kernels.compiling import Array, inlined
from kinarm.kernels.kinematics import POSE
from kinarm.kernels.lanes import LANES, as_numbers, lanes
from kinarm.kernels.records import Fixed, Layout

ONE = Fixed(1)


class Block(NamedTuple):
    """Work space of a block of episodes.

    Its arrays are of lanes; `kinarm.kernels.lanes.as_numbers` views them with one axis more, that
    of the episodes.

    Attributes
    ----------
    q, target : (1, n_joints)
        Configuration, and where the step leads [rad or m].
    goal : (1, 3)
        Goal position [m].
    observation, seen : (1, n_observations)
        Observation, and as a mirrored network sees it.
    before, after : (n_joints + 1, POSE)
        Forward kinematics before and after the step; which is which changes from step to step.
    planes : (n_pairs + 1, PLANE)
        Separating plane of each pair, and the height above it; see `kinarm.kernels.planes`. The
        last row is work space.
    height, bend, bound : (n_pairs,)
        Height before the step, its bend, and the bound that follows [m].
    twist : (n_actuated, n_actuated)
        How far an axis (column) moves in the step, times itself and twice those before it, from
        the first one (row) that counts [rad^2].
    action : (1, n_actuated)
        Fractions of the step limits.
    hidden : (2, widest layer)
        Layers of networks.
    weights : (n_parameters,) or (0,)
        Parameters, if every episode has a network of its own.
    distance, total, steps, stop : (1,)
        Distance to the goal [m], return, steps taken, and step at which to hand back.
    alive, cleared : (1,)
        1 where there is an episode, and where its step under way was found free by Coal; else 0.
    terms : (1, n_terms)
        Weighted terms of the last reward.
    row : (LANES,) of whole numbers, not of lanes
        Which episode is in a lane; -1 where none is.
    first, second : (n_observations,) or (0,)
        Sums of the observations acted upon, less the shift, and of their squares.
    """

    q: Array
    target: Array
    goal: Array
    observation: Array
    seen: Array
    before: Array
    after: Array
    planes: Array
    height: Array
    bend: Array
    bound: Array
    twist: Array
    action: Array
    hidden: Array
    weights: Array
    distance: Array
    total: Array
    steps: Array
    stop: Array
    alive: Array
    cleared: Array
    terms: Array
    first: Array
    second: Array
    row: NDArray[np.int64]


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
    """

    q: Array
    before: Array
    after: Array
    plane: Array
    relative: Array
    simplex: Array
    listed: NDArray[np.int64]


def work_space(**sizes: int) -> tuple[Block, Alone]:
    """Records of a block, and of the space for a single episode; sizes are those of `layouts`."""
    block, alone = layouts(**sizes)
    return block.record(), alone.record()


@cache
def layouts(
    n_joints: int,
    n_actuated: int = 0,
    n_observations: int = 0,
    n_pairs: int = 0,
    n_terms: int = 0,
    widest: int = 0,
    own: int = 0,
    summed: int = 0,
) -> tuple[Layout, Layout]:
    """How `Block` and `Alone` lie in memory.

    Parameters
    ----------
    n_joints, n_actuated, n_observations, n_pairs, n_terms, widest : int
        Sizes of arm, scene, reward and networks; 0 of what a kernel does without.
    own : int
        Parameters of an episode's network, if not all have the same.
    summed : int
        Entries of the observation that are summed, all or none.
    """
    block = {
        "q": (ONE, n_joints),
        "target": (ONE, n_joints),
        "goal": (ONE, Fixed(3)),
        "observation": (ONE, n_observations),
        "seen": (ONE, n_observations),
        "before": (n_joints + 1, Fixed(POSE)),
        "after": (n_joints + 1, Fixed(POSE)),
        "planes": (n_pairs + 1, Fixed(PLANE)),
        "height": (n_pairs,),
        "bend": (n_pairs,),
        "bound": (n_pairs,),
        "twist": (n_actuated, n_actuated),
        "action": (ONE, n_actuated),
        "hidden": (Fixed(2), widest),
        "weights": (own,),
        **dict.fromkeys(("distance", "total", "steps", "stop", "alive", "cleared"), (ONE,)),
        "terms": (ONE, n_terms),
        "first": (summed,),
        "second": (summed,),
    }
    alone = {
        "q": (ONE, n_joints),
        "before": (n_joints + 1, Fixed(POSE)),
        "after": (n_joints + 1, Fixed(POSE)),
        "plane": (ONE, Fixed(PLANE)),
        "relative": (Fixed(4), Fixed(3)),
        "simplex": (Fixed(4), Fixed(3)),
    }
    in_lanes = {name: (lanes, shape) for name, shape in block.items()}
    numbers = {name: (types.float64, shape) for name, shape in alone.items()}
    return (
        Layout("Block", {**in_lanes, "row": (types.int64, (Fixed(LANES),))}),
        Layout("Alone", {**numbers, "listed": (types.int64, (n_pairs + 1, Fixed(2)))}),
    )


@inlined
def load_episode(e: int, lane: int, control: Control, episodes: Episodes, block: Block) -> None:
    """Put an episode into a lane; its observation only if something depends on it."""
    q = as_numbers(block.q)
    target = as_numbers(block.target)
    goal = as_numbers(block.goal)
    observation = as_numbers(block.observation)
    planes = as_numbers(block.planes)
    weights = as_numbers(block.weights)
    first = as_numbers(block.first)
    second = as_numbers(block.second)
    distance = as_numbers(block.distance)
    total = as_numbers(block.total)
    steps = as_numbers(block.steps)
    stop = as_numbers(block.stop)
    cleared = as_numbers(block.cleared)
    alive = as_numbers(block.alive)
    for joint in range(block.q.shape[1]):
        q[0, joint, lane] = episodes.q[e, joint]
        target[0, joint, lane] = episodes.target[e, joint]
    for i in range(3):
        goal[0, i, lane] = episodes.goal[e, i]
    if control.layers.shape[0] > 0 or block.first.shape[0] > 0:
        for i in range(block.observation.shape[1]):
            observation[0, i, lane] = episodes.observation[e, i]
    for pair in range(episodes.planes.shape[1]):
        for i in range(PLANE):
            planes[pair, i, lane] = episodes.planes[e, pair, i]
    for i in range(block.weights.shape[0]):
        weights[i, lane] = control.weights[control.policy[e], i]
    for i in range(block.first.shape[0]):
        first[i, lane] = episodes.moments[e, 0, i]
        second[i, lane] = episodes.moments[e, 1, i]
    distance[0, lane] = episodes.distance[e]
    total[0, lane] = episodes.total[e]
    steps[0, lane] = episodes.steps[e]
    stop[0, lane] = episodes.stop[e]
    cleared[0, lane] = 1.0 if episodes.cleared[e] else 0.0
    alive[0, lane] = 1.0


@inlined
def store_episode(lane: int, e: int, episodes: Episodes, block: Block) -> None:
    """Hand an episode back from a lane, which is then free."""
    q = as_numbers(block.q)
    target = as_numbers(block.target)
    observation = as_numbers(block.observation)
    planes = as_numbers(block.planes)
    first = as_numbers(block.first)
    second = as_numbers(block.second)
    terms = as_numbers(block.terms)
    distance = as_numbers(block.distance)
    total = as_numbers(block.total)
    steps = as_numbers(block.steps)
    alive = as_numbers(block.alive)
    for joint in range(block.q.shape[1]):
        episodes.q[e, joint] = q[0, joint, lane]
        episodes.target[e, joint] = target[0, joint, lane]
    if int(steps[0, lane]) > episodes.steps[e]:
        for i in range(block.observation.shape[1]):
            episodes.observation[e, i] = observation[0, i, lane]
    for pair in range(episodes.planes.shape[1]):
        for i in range(PLANE):
            episodes.planes[e, pair, i] = planes[pair, i, lane]
    for i in range(block.first.shape[0]):
        episodes.moments[e, 0, i] = first[i, lane]
        episodes.moments[e, 1, i] = second[i, lane]
    for term in range(block.terms.shape[1]):
        episodes.terms[e, term] = terms[0, term, lane]
    episodes.distance[e] = distance[0, lane]
    episodes.total[e] = total[0, lane]
    episodes.steps[e] = int(steps[0, lane])
    episodes.cleared[e] = False
    alive[0, lane] = 0.0
