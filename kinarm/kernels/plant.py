"""Kernels of a plant: how an episode's is drawn, how commands move joints, and what is seen.

A servo is stepped exactly, as a linear system with the state (q - command, velocity); limits hold
in each of `SUBSTEPS` parts of a step.
"""

import math

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.episodes import Episodes, Rules
from kinarm.kernels.compiling import Array, inlined, kernel
from kinarm.kernels.elementary import TURN, exponential, nearest_whole, sine_cosine
from kinarm.kernels.kinematics import forward_kinematics
from kinarm.kernels.lanes import any_lane, as_numbers, select
from kinarm.kernels.placing import STEP, mixed, seed_state, uniform
from kinarm.kernels.work_space import Block

SEED = 0xBF58476D1CE4E5B9
"""Begins the random numbers of plants, which are not those of scenes."""

SUBSTEPS = 5
"""Parts of a step in which limits of velocity and acceleration hold."""

DELAY, RESOLUTION, NOISE, GOAL_NOISE, HIGH_BITS, LOW_BITS = range(6)
SERVO, MOST_CHANGE, TRAPEZE, RATE, STEADY, OFFSETS = 6, 10, 11, 12, 13, 14
"""Entries of an episode's plant: delay [steps], resolution, standard deviations of noise, and the
bits of its random state; the servo's matrix for a part of a step, most change of velocity in one,
and how much of that change the part's way lacks. `kinarm.kernels.shield` knows the servo's natural
frequency [1/s], and how fast the joints may swing without meeting those limits. Then follow bias
and calibration of each joint, and the goal's bias."""

COMMAND, VELOCITY, FORMER = range(3)
"""Rows of an episode's drive: command, velocity, and former commands."""


def plant_width(n_actuated: int) -> int:
    """Entries of an episode's plant."""
    return OFFSETS + 2 * n_actuated + 3


@kernel
def draw_plants(
    first: int, last: int, ranges: Array, part: float, bits: NDArray[np.uint64], plants: Array
) -> None:
    """Draw the plants of some episodes.

    Parameters
    ----------
    first, last
        Range of the rows.
    ranges : ndarray, shape (n_ranges, 2)
        Lower and upper ends of `kinarm.plant.RANGES`.
    part : float
        Duration of a part of a step [s].
    bits : ndarray, shape (n, goal_width + n_joints)
        Bits of goals and starts.
    plants : ndarray, shape (n, plant_width(n_actuated))
        Where plants go.
    """
    state, drawn = np.empty(1, dtype=np.uint64), np.empty(ranges.shape[0])
    n_actuated = (plants.shape[1] - OFFSETS - 3) // 2
    for e in range(first, last):
        plant = plants[e]
        seed_state(state, SEED, bits, e)
        for i in range(drawn.shape[0]):
            lower, upper = ranges[i, 0], ranges[i, 1]
            drawn[i] = lower + uniform(state) * (upper - lower)
        # As likely for each number of steps.
        lower, upper = ranges[0, 0], ranges[0, 1]
        plant[DELAY] = lower + math.floor(uniform(state) * (upper - lower + 1.0))
        bandwidth, damping, acceleration = drawn[1], drawn[2], drawn[3]
        plant[RESOLUTION], plant[NOISE], plant[GOAL_NOISE] = drawn[4], drawn[5], drawn[8]
        plant[MOST_CHANGE] = acceleration * part if acceleration > 0.0 else np.inf
        plant[TRAPEZE] = 0.5 if bandwidth > 0.0 else 0.0
        fill_servo(plant, bandwidth, damping, part)
        for kind in range(2):
            for axis in range(n_actuated):
                offset = drawn[6 + kind] * (2.0 * uniform(state) - 1.0)
                plant[OFFSETS + kind * n_actuated + axis] = offset
        for i in range(3):
            plant[OFFSETS + 2 * n_actuated + i] = drawn[9] * (2.0 * uniform(state) - 1.0)
        # The numbers that follow are those of the noise.
        plant[HIGH_BITS] = float(state[0] >> np.uint64(32))
        plant[LOW_BITS] = float(state[0] & np.uint64(0xFFFFFFFF))


@inlined
def fill_servo(plant: Array, bandwidth: float, damping: float, part: float) -> None:
    """Fill in how a servo's error and velocity follow from those a part of a step before.

    And the rate of the joints' swing, and up to which speed no limit acts on it: a servo
    accelerates by at most rate^2 |e| + 2 damping rate |v|; joints that obey at once change their
    velocity by at most |v| + rate |e|.
    """
    rate = TURN * bandwidth
    decay, split = rate * damping, rate * math.sqrt(abs(1.0 - damping * damping))
    # Of two exponentials, the slower one says whether a part of a step is long.
    slowest = decay - split if damping > 1.0 else decay
    if bandwidth == 0.0 or slowest * part > 500.0:
        plant[SERVO], plant[SERVO + 1] = 0.0, 0.0
        plant[SERVO + 2], plant[SERVO + 3] = -1.0 / part, 0.0
        plant[RATE], gain = 1.0 / part, 2.0
    else:
        # e'' = -rate^2 e - 2 damping rate e', by its two exponentials or damped oscillation.
        if split * part < 1e-6:
            even, odd = exponential(-decay * part), part * exponential(-decay * part)
        elif damping < 1.0:
            sine, cosine = sine_cosine(split * part)
            left = exponential(-decay * part)
            even, odd = left * cosine, left * sine / split
        else:
            slow = exponential((split - decay) * part)
            fast = exponential(max(-(split + decay) * part, -700.0))
            even, odd = 0.5 * (slow + fast), 0.5 * (slow - fast) / split
        plant[SERVO], plant[SERVO + 1] = even + decay * odd, odd
        plant[SERVO + 2], plant[SERVO + 3] = -rate * rate * odd, even - decay * odd
        plant[RATE], gain = rate, rate * part * (1.0 + 2.0 * damping)
    plant[STEADY] = plant[MOST_CHANGE] / gain


@inlined
def move_joints(chain: Chain, rules: Rules, fresh: bool, block: Block) -> None:
    """Command the joints of a block, and fill in where they are at the step's end."""
    plant, drive = block.plant, block.drive
    n_actuated, longest = rules.step_limit.shape[0], drive.shape[0] - FORMER
    part = rules.time_step / SUBSTEPS
    for axis in range(n_actuated):
        limit, lower, upper = rules.step_limit[axis], chain.lower[axis], chain.upper[axis]
        command = min(max(drive[COMMAND, axis] + block.action[0, axis] * limit, lower), upper)
        resolution = plant[0, RESOLUTION]
        whole = nearest_whole(command / resolution) * resolution
        command = select(resolution > 0.0, whole, command)
        if block.holds.shape[0] > 0:
            command = select(block.holds[0] > 0.0, drive[COMMAND, axis], command)
        for k in range(longest - 1, 0, -1):
            older, later = drive[FORMER + k, axis], drive[FORMER + k - 1, axis]
            drive[FORMER + k, axis] = select(fresh, later, older)
        if longest > 0:
            drive[FORMER, axis] = select(fresh, drive[COMMAND, axis], drive[FORMER, axis])
        drive[COMMAND, axis] = select(fresh, command, drive[COMMAND, axis])
        told = command
        for k in range(longest):
            told = select(plant[0, DELAY] == k + 1.0, drive[FORMER + k, axis], told)
        told += plant[0, OFFSETS + n_actuated + axis]
        start, velocity = block.q[0, axis], drive[VELOCITY, axis]
        q, fastest = start, limit / rules.time_step
        for _ in range(SUBSTEPS):
            error = q - told
            exact = told + plant[0, SERVO] * error + plant[0, SERVO + 1] * velocity
            wanted = plant[0, SERVO + 2] * error + plant[0, SERVO + 3] * velocity
            free, change = wanted - velocity, min(max(wanted, -fastest), fastest) - velocity
            change = min(max(change, -plant[0, MOST_CHANGE]), plant[0, MOST_CHANGE])
            velocity += change
            way = part * (velocity - plant[0, TRAPEZE] * change)
            q = min(max(select(change == free, exact, q + way), lower), upper)
            stopped = (q <= lower) | (q >= upper)
            velocity = select(stopped, 0.0, velocity)
        within = min(max(q, start - limit), start + limit)
        block.target[0, axis] = select(fresh, within, block.target[0, axis])
        drive[VELOCITY, axis] = select(fresh, velocity, drive[VELOCITY, axis])


@inlined
def rest(e: int, episodes: Episodes) -> None:
    """Let an episode's joints rest where they are."""
    drive, n_actuated = episodes.drive, episodes.drive.shape[2]
    for row in range(drive.shape[1]):
        for axis in range(n_actuated):
            command = episodes.q[e, axis] - episodes.plant[e, OFFSETS + n_actuated + axis]
            drive[e, row, axis] = 0.0 if row == VELOCITY else command


@inlined
def sense(chain: Chain, rules: Rules, block: Block) -> None:
    """Fill in which joint positions and goal are seen, and the poses there."""
    plant, n_actuated = block.plant, rules.step_limit.shape[0]
    for joint in range(block.q.shape[1]):
        block.sensed[0, joint] = block.q[0, joint]
    for axis in range(n_actuated):
        bias, calibration = plant[0, OFFSETS + axis], plant[0, OFFSETS + n_actuated + axis]
        block.sensed[0, axis] += bias - calibration
    for i in range(3):
        block.seen_goal[0, i] = block.goal[0, i] + plant[0, OFFSETS + 2 * n_actuated + i]
    for i in range(3, block.goal.shape[1]):
        block.seen_goal[0, i] = block.goal[0, i]
    if any_lane((plant[0, NOISE] > 0.0) | (plant[0, GOAL_NOISE] > 0.0)):
        add_noise(block, n_actuated)
    if rules.commanded == 1:
        for axis in range(n_actuated):
            block.sensed[0, axis] = block.drive[COMMAND, axis]
    forward_kinematics(chain, block.sensed, 0, block.seen_poses)


@inlined
def add_noise(block: Block, n_actuated: int) -> None:
    """Add noise to what is seen: sums of four numbers, nearly normal, within 3.5 deviations."""
    plant, steps = as_numbers(block.plant), as_numbers(block.steps)
    sensed, goal = as_numbers(block.sensed), as_numbers(block.seen_goal)
    for lane in range(plant.shape[2]):
        high, low = np.uint64(plant[0, HIGH_BITS, lane]), np.uint64(plant[0, LOW_BITS, lane])
        state = (high << np.uint64(32)) | low
        state += np.uint64(STEP) * np.uint64(1 + int(steps[0, lane]) * (n_actuated + 3))
        for i in range(n_actuated + 3):
            bits = mixed(state)
            state += np.uint64(STEP)
            total = 2.0 * 2.0**-16 - 2.0
            for _ in range(4):
                total += float(bits & np.uint64(0xFFFF)) * 2.0**-16
                bits >>= np.uint64(16)
            # The variance of four such numbers is a third.
            total *= 1.7320508075688772
            if i < n_actuated:
                sensed[0, i, lane] += plant[0, NOISE, lane] * total
            else:
                goal[0, i - n_actuated, lane] += plant[0, GOAL_NOISE, lane] * total
