"""The scene of an episode, drawn from its start and goal.

Numbers come from a generator (Steele, Lea and Flood 2014, SplitMix64) that the bits of seed, goal
and start begin: on every machine, and in any batch, an episode has the same scene.
"""

import math

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.kernels.compiling import Array, Vector, helper, kernel
from kinarm.kernels.elementary import TURN, sine_cosine
from kinarm.kernels.kinematics import POSE, forward_kinematics, to_frame, to_world
from kinarm.scene_draws import ON_BODY, ON_PATH, SceneDraws

ATTEMPTS = 1000
"""Places tried for a body, until one is clear of the goal."""

STEP, FIRST, SECOND = 0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB
"""Constants of the generator."""


@helper
def mixed(state: np.uint64) -> np.uint64:
    """Random bits of a state of the generator."""
    bits = (state ^ (state >> np.uint64(30))) * np.uint64(FIRST)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(SECOND)
    return bits ^ (bits >> np.uint64(31))


@helper
def seed_state(state: NDArray[np.uint64], seed: int, bits: NDArray[np.uint64], e: int) -> None:
    """Begin an episode's generator with a seed and the bits of its goal and start."""
    state[0] = np.uint64(seed)
    for i in range(bits.shape[1]):
        state[0] = mixed(state[0] + np.uint64(STEP)) ^ bits[e, i]


@helper
def uniform(state: NDArray[np.uint64]) -> float:
    """Next number in [0, 1)."""
    state[0] += np.uint64(STEP)
    return float(mixed(state[0]) >> np.uint64(11)) * 2.0**-53


@helper
def turn_row(turn: int, state: NDArray[np.uint64], row: Array) -> None:
    """Fill in the rotation matrix of a row: not turned, by a yaw, or anyhow."""
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    if turn == 1:
        z, w = sine_cosine(0.5 * TURN * (uniform(state) - 0.5))
    elif turn == 2:
        norm = 2.0
        # Uniform in a ball of four dimensions, so in all directions.
        while norm > 1.0 or norm < 0.01:
            w, x = 2.0 * uniform(state) - 1.0, 2.0 * uniform(state) - 1.0
            y, z = 2.0 * uniform(state) - 1.0, 2.0 * uniform(state) - 1.0
            norm = w * w + x * x + y * y + z * z
        norm = math.sqrt(norm)
        w, x, y, z = w / norm, x / norm, y / norm, z / norm
    row[4], row[5], row[6] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    row[7], row[8], row[9] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    row[10], row[11], row[12] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


@helper
def distance_to_box(rows: Array, body: int, extents: Array, point: Vector) -> float:
    """Distance of a point from the box about a body, less its rounding [m]."""
    x, y, z = to_frame(rows, body, point)
    sx, sy, sz = rows[body, 0], rows[body, 1], rows[body, 2]
    x -= min(max(x, sx * extents[0, 0]), sx * extents[1, 0])
    y -= min(max(y, sy * extents[0, 1]), sy * extents[1, 1])
    z -= min(max(z, sz * extents[0, 2]), sz * extents[1, 2])
    return math.sqrt(x * x + y * y + z * z) - rows[body, 3]


@kernel
def draw_scenes(
    first: int,
    last: int,
    chain: Chain,
    draws: SceneDraws,
    starts: Array,
    goals: Array,
    bits: NDArray[np.uint64],
    scenes: Array,
    failed: NDArray[np.int64],
) -> None:
    """Draw the scenes of some episodes.

    Parameters
    ----------
    first, last, chain, draws
        Range of the rows, the arm, and how scenes are drawn.
    starts, goals, bits : ndarray, shape (n, n_joints), (n, 3) and (n, 3 + n_joints)
        Starts [rad or m], goals [m], and the bits of both.
    scenes : ndarray, shape (n, n_placed, 16)
        Where rows of all bodies go.
    failed : ndarray of int, shape (n,)
        Where the number of the first entry goes, from 1, that had a body
        without a place clear of the goal; 0 if there is none.
    """
    poses, state = np.empty((starts.shape[1] + 1, POSE)), np.empty(1, dtype=np.uint64)
    numbers = np.empty(3)
    for e in range(first, last):
        rows, goal = scenes[e], (goals[e, 0], goals[e, 1], goals[e, 2])
        rows[:] = draws.placed
        failed[e] = 0
        seed_state(state, draws.seed, bits, e)
        forward_kinematics(chain, starts, e, poses)
        tool = to_world(poses, starts.shape[1], chain.tool[0], chain.tool[1], chain.tool[2])
        for entry in range(draws.entries.shape[0]):
            given, places = draws.entries[entry], draws.places[entry]
            row, fewest, most = given[0], given[1], given[2]
            near, surface, extents = given[3], given[4], draws.extents[entry]
            low, high = places[0], places[1]
            count = fewest + int(uniform(state) * (most - fewest + 1))
            for body in range(row, row + count):
                placed = False
                for _ in range(ATTEMPTS):
                    for i in range(3):
                        numbers[i] = uniform(state)
                    for i in range(4):
                        least, largest = draws.sizes[entry, 0, i], draws.sizes[entry, 1, i]
                        share = numbers[draws.measures[entry, i]]
                        rows[body, i] = least + share * (largest - least)
                    turn_row(given[5], state, rows[body])
                    x = low[0] + uniform(state) * (high[0] - low[0])
                    y = low[1] + uniform(state) * (high[1] - low[1])
                    z = low[2] + uniform(state) * (high[2] - low[2])
                    if near == ON_PATH:
                        share = uniform(state)
                        x += tool[0] + share * (goal[0] - tool[0])
                        y += tool[1] + share * (goal[1] - tool[1])
                        z += tool[2] + share * (goal[2] - tool[2])
                    elif near == ON_BODY:
                        # It stands on the obstacle's top.
                        z += rows[surface, 2] + rows[body, 3] - rows[body, 2] * extents[0, 2]
                        x, y, z = to_world(rows, surface, x, y, z)
                    rows[body, 13], rows[body, 14], rows[body, 15] = x, y, z
                    if distance_to_box(rows, body, extents, goal) > draws.clear[entry]:
                        placed = True
                        break
                if not placed and failed[e] == 0:
                    failed[e] = entry + 1
