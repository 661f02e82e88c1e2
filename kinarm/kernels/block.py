"""A block of episodes, side by side in lanes, and how episodes get into it and out again."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.episodes import Control, Episodes
from kinarm.kernels.compiling import Array, inlined


class Block(NamedTuple):
    """Work space of a block of episodes.

    Kernels have it twice: as arrays of lanes of the shapes below, and as the numbers behind them,
    whose arrays have one axis more, that of the episodes.

    Attributes
    ----------
    q, target, middle : (1, n_joints)
        Configuration, where the step leads, and one between [rad or m].
    goal : (1, 3)
        Goal position [m].
    observation, seen : (1, n_observations)
        Observation, and as a mirrored network sees it.
    slack, motion : (n_pairs,)
        Lower bound of each pair's distance, and of how far the step moves it [m].
    poses, between : (n_joints + 1, POSE)
        Forward kinematics at the target, and between.
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
    open : ndarray of int, shape (n_pairs, tested)
        Pairs with configurations in question, and the bits of the episodes for each.
    doubt : ndarray of int, shape (LANES,)
        Bit k set: configuration k + 1 of the step under way is not proven free.
    episode : ndarray of int, shape (LANES,)
        Rows of the episodes; -1 where there is none.
    """

    q: Array
    target: Array
    middle: Array
    goal: Array
    observation: Array
    seen: Array
    slack: Array
    motion: Array
    poses: Array
    between: Array
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
    open: NDArray[np.int64]
    doubt: NDArray[np.int64]
    episode: NDArray[np.int64]


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
    for pair in range(numbers.slack.shape[0]):
        numbers.slack[pair, lane] = episodes.slack[e, pair]
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
    numbers.episode[lane] = e


@inlined
def put_back(lane: int, episodes: Episodes, numbers: Block) -> int:
    """Hand an episode back from a lane, which is then free; returns its row."""
    e = numbers.episode[lane]
    for joint in range(numbers.q.shape[1]):
        episodes.q[e, joint] = numbers.q[0, joint, lane]
        episodes.target[e, joint] = numbers.target[0, joint, lane]
    for i in range(numbers.observation.shape[1]):
        episodes.observation[e, i] = numbers.observation[0, i, lane]
    for pair in range(numbers.slack.shape[0]):
        episodes.slack[e, pair] = numbers.slack[pair, lane]
    for i in range(numbers.first.shape[0]):
        episodes.moments[e, 0, i] = numbers.first[i, lane]
        episodes.moments[e, 1, i] = numbers.second[i, lane]
    for term in range(numbers.terms.shape[1]):
        episodes.terms[e, term] = numbers.terms[0, term, lane]
    episodes.distance[e] = numbers.distance[0, lane]
    episodes.total[e] = numbers.total[0, lane]
    episodes.steps[e] = int(numbers.steps[0, lane])
    episodes.cleared[e] = False
    numbers.episode[lane] = -1
    numbers.alive[0, lane] = 0.0
    return e
