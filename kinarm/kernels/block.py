"""A block of episodes, side by side in lanes, and how episodes get into it and out again."""

from functools import cache
from typing import Any, TypeAlias

from numba import types

from kinarm.contact_shapes import PLANE
from kinarm.episodes import Control, Episodes
from kinarm.kernels.compiling import Array, inlined
from kinarm.kernels.kinematics import POSE
from kinarm.kernels.lanes import LANES, as_numbers, lanes
from kinarm.kernels.records import Fixed, Layout, Shapes

ONE, THREE = Fixed(1), Fixed(3)

Block: TypeAlias = Any
"""Work space of a block of episodes, a record of lanes: see `layouts`."""

Alone: TypeAlias = Any
"""Work space for a single episode of a block, a record of numbers: see `layouts`."""


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
    """Arrays of a block and of the space for a single episode, and how they lie in memory.

    Arrays of lanes are seen with one axis more, that of the episodes, by
    `kinarm.kernels.lanes.as_numbers`.

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
        # Configuration, where the step leads [rad or m], and the goal's position [m].
        "q": (ONE, n_joints),
        "target": (ONE, n_joints),
        "goal": (ONE, THREE),
        # Observation, and as a mirrored network sees it.
        "observation": (ONE, n_observations),
        "seen": (ONE, n_observations),
        # Forward kinematics before and after the step; which is which changes from step to step.
        "before": (n_joints + 1, Fixed(POSE)),
        "after": (n_joints + 1, Fixed(POSE)),
        # Separating plane of each pair, and the height above it; the last row is work space.
        "planes": (n_pairs + 1, Fixed(PLANE)),
        # Height before the step, its bend, and the bound that follows [m].
        **dict.fromkeys(("height", "bend", "bound"), (n_pairs,)),
        # How far an axis (column) moves in the step, times itself and twice those before it, from
        # the first one (row) that counts [rad^2].
        "twist": (n_actuated, n_actuated),
        # Fractions of the step limits; layers of networks; parameters of own networks.
        "action": (ONE, n_actuated),
        "hidden": (Fixed(2), widest),
        "weights": (ONE, own),
        # Distance to the goal [m], return, steps taken, and step at which to hand back; 1 where
        # there is an episode, and where its step under way was found free by Coal, else 0.
        **dict.fromkeys(("distance", "total", "steps", "stop", "alive", "cleared"), (ONE,)),
        # Weighted terms of the last reward.
        "terms": (ONE, n_terms),
        # Sums of the observations acted upon, less the shift, and of their squares.
        "moments": (Fixed(2), summed),
    }
    alone = {
        # A configuration, the poses before the step or between, and after it, and a plane.
        "q": (ONE, n_joints),
        "before": (n_joints + 1, Fixed(POSE)),
        "after": (n_joints + 1, Fixed(POSE)),
        "plane": (ONE, Fixed(PLANE)),
        # See `kinarm.kernels.separation.separate`.
        "relative": (ONE, Fixed(POSE)),
        "simplex": (Fixed(4), THREE),
    }
    in_lanes: Shapes = {name: (lanes, shape) for name, shape in block.items()}
    numbers: Shapes = {name: (types.float64, shape) for name, shape in alone.items()}
    # Which episode is in a lane, -1 where none is; pairs in question, and at which configurations.
    in_lanes["row"] = (types.int64, (Fixed(LANES),))
    numbers["listed"] = (types.int64, (n_pairs + 1, Fixed(2)))
    return Layout("Block", in_lanes), Layout("Alone", numbers)


@inlined
def put(rows: Array, e: int, held: Array, row: int, lane: int) -> None:
    """Copy a row of an array into a lane of a row of an array of lanes."""
    numbers = as_numbers(held)
    for i in range(numbers.shape[1]):
        numbers[row, i, lane] = rows[e, i]


@inlined
def take(held: Array, row: int, lane: int, rows: Array, e: int) -> None:
    """Copy a lane of a row of an array of lanes into a row of an array."""
    numbers = as_numbers(held)
    for i in range(numbers.shape[1]):
        rows[e, i] = numbers[row, i, lane]


@inlined
def take_rows(held: Array, lane: int, rows: Array) -> None:
    """Copy a lane of an array of lanes into as many rows as an array has."""
    for row in range(rows.shape[0]):
        take(held, row, lane, rows, row)


@inlined
def load_episode(e: int, lane: int, control: Control, episodes: Episodes, block: Block) -> None:
    """Put an episode into a lane; its observation only if something depends on it."""
    put(episodes.q, e, block.q, 0, lane)
    put(episodes.target, e, block.target, 0, lane)
    put(episodes.goal, e, block.goal, 0, lane)
    if control.layers.shape[0] > 0 or block.moments.shape[1] > 0:
        put(episodes.observation, e, block.observation, 0, lane)
    for pair in range(episodes.planes.shape[1]):
        put(episodes.planes[e], pair, block.planes, pair, lane)
    if block.weights.shape[1] > 0:
        put(control.weights, control.policy[e], block.weights, 0, lane)
    for power in range(2):
        put(episodes.moments[e], power, block.moments, power, lane)
    as_numbers(block.distance)[0, lane] = episodes.distance[e]
    as_numbers(block.total)[0, lane] = episodes.total[e]
    as_numbers(block.steps)[0, lane] = episodes.steps[e]
    as_numbers(block.stop)[0, lane] = episodes.stop[e]
    as_numbers(block.cleared)[0, lane] = 1.0 if episodes.cleared[e] else 0.0
    as_numbers(block.alive)[0, lane] = 1.0


@inlined
def store_episode(lane: int, e: int, episodes: Episodes, block: Block) -> None:
    """Hand an episode back from a lane, which is then free."""
    steps = int(as_numbers(block.steps)[0, lane])
    take(block.q, 0, lane, episodes.q, e)
    take(block.target, 0, lane, episodes.target, e)
    if steps > episodes.steps[e]:
        take(block.observation, 0, lane, episodes.observation, e)
    take_rows(block.planes, lane, episodes.planes[e])
    take_rows(block.moments, lane, episodes.moments[e])
    take(block.terms, 0, lane, episodes.terms, e)
    episodes.distance[e] = as_numbers(block.distance)[0, lane]
    episodes.total[e] = as_numbers(block.total)[0, lane]
    episodes.steps[e] = steps
    episodes.cleared[e] = False
    as_numbers(block.alive)[0, lane] = 0.0
