"""Inverse kinematics: all configurations for the wanted tool, from many seeds.

Seeds move by damped Newton steps (Levenberg 1944, Marquardt 1963), whose damping shrinks with the
square of the error, so that they converge quadratically. Lanes take eight at a time.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.kernels.compiling import Array, Vector, helper, inlined, kernel
from kinarm.kernels.elementary import TURN, nearest_whole
from kinarm.kernels.kinematics import POSE, forward_kinematics, point_jacobian, rotated, to_world
from kinarm.kernels.lanes import LANES, any_lane, as_lanes, as_numbers, lane_bits, select

PRECISION = 1e-10
"""Error at which a seed stops: share of the arm's reach, and angle [rad]."""

ITERATIONS = 48
"""Steps of a seed at most."""

PATIENCE, PROGRESS = 20, 0.98
"""Steps before a seed ends that no longer shrinks its squared error to this share."""

DAMPING, LEAST_DAMPING = 0.1, 1e-12
"""Added to the diagonal of J J^T: share of the squared error, and at least this."""

HITS = 3
"""Arrivals at each solution before the search for isolated ones ends."""

ROUNDING = 1e-9
"""How far a solution beyond a limit is moved to it [rad or m]."""


class Search(NamedTuple):
    """Target coordinates and seeds of a search.

    Attributes
    ----------
    tool : ndarray, shape (3,)
        Tool point in the last joint frame [m].
    axes : ndarray, shape (n_axes, 3)
        Unit vectors of the last joint frame whose directions are wanted; none,
        one or three.
    scale : float
        Inverse of the arm's reach [1/m].
    position_tolerance, rotation_tolerance : float
        Errors with which seeds arrive that come no closer [m, rad].
    near : ndarray, shape (n_joints,)
        First seed, where other joints rest and to which whole turns are
        closest.
    seeds : ndarray, shape (n_seeds, n)
        Further seeds between the limits of the first n joints, from 0 to 1.
    least : int
        Seeds before the search for isolated solutions may end; 0 if it may not.
    separation : float
        Least difference of two solutions in some joint [rad or m].
    """

    tool: Array
    axes: Array
    scale: float
    position_tolerance: float
    rotation_tolerance: float
    near: Array
    seeds: Array
    least: int
    separation: float


@inlined
def half_turn_factor(cosine: float) -> float:
    """From the sine of an angle to twice that of its half, which grows up to a half turn."""
    return 1.0 / math.sqrt(max(0.5 + 0.5 * cosine, 1e-6))


@inlined
def take_out_turns(axis: Vector, jacobian: Array) -> None:
    """Take turns about an axis out of the last three rows of a Jacobian."""
    for k in range(jacobian.shape[1]):
        along = axis[0] * jacobian[3, k] + axis[1] * jacobian[4, k] + axis[2] * jacobian[5, k]
        jacobian[3, k] -= along * axis[0]
        jacobian[4, k] -= along * axis[1]
        jacobian[5, k] -= along * axis[2]


@inlined
def orientation_error(axes: Array, poses: Array, wanted: Array, jacobian: Array) -> Vector:
    """Vector about which the tool has to turn, as long as a small angle is [rad].

    With one axis, the Jacobian's last three rows lose turns about it.
    """
    n_axes, last = axes.shape[0], poses.shape[0] - 1
    zero = 0.0 * poses[last, 13]
    wx, wy, wz, cosine = zero, zero, zero, zero
    for i in range(n_axes):
        ax, ay, az = rotated(poses, last, axes[i, 0], axes[i, 1], axes[i, 2])
        bx, by, bz = wanted[i, 0], wanted[i, 1], wanted[i, 2]
        wx += ay * bz - az * by
        wy += az * bx - ax * bz
        wz += ax * by - ay * bx
        cosine += ax * bx + ay * by + az * bz
        if n_axes == 1:
            take_out_turns((ax, ay, az), jacobian)
    if n_axes == 3:
        wx, wy, wz, cosine = 0.5 * wx, 0.5 * wy, 0.5 * wz, 0.5 * (cosine - 1.0)
    longer = half_turn_factor(cosine)
    return longer * wx, longer * wy, longer * wz


@inlined
def damped_step(jacobian: Array, error: Array, damping: float, square: Array, step: Array) -> None:
    """Fill in J^T (J J^T + damping)^-1 e, by a Cholesky decomposition without roots.

    ``square``, shape (rows + 1, rows), is work space.
    """
    rows, n = jacobian.shape
    solved = square[rows]
    for i in range(rows):
        solved[i] = error[i]
        for j in range(i + 1):
            entry = 0.0 * damping
            for k in range(n):
                entry += jacobian[i, k] * jacobian[j, k]
            square[i, j] = entry
        square[i, i] += damping
    # The factor below the diagonal, and times the pivot above it.
    for j in range(rows):
        inverse = 1.0 / square[j, j]
        for i in range(j + 1, rows):
            square[j, i] = square[i, j]
            square[i, j] = square[i, j] * inverse
        for i in range(j + 1, rows):
            for k in range(j + 1, i + 1):
                square[i, k] -= square[i, j] * square[j, k]
            solved[i] -= square[i, j] * solved[j]
        square[j, j] = inverse
    for i in range(rows - 1, -1, -1):
        solved[i] = solved[i] * square[i, i]
        for j in range(i + 1, rows):
            solved[i] -= square[j, i] * solved[j]
    for k in range(n):
        step[k] = 0.0 * damping
        for i in range(rows):
            step[k] += jacobian[i, k] * solved[i]


@helper
def keep_new(
    q: Array,
    lane: int,
    search: Search,
    chain: Chain,
    n: int,
    configurations: Array,
    hits: NDArray[np.int64],
    found: int,
) -> int:
    """Add a lane's configuration to the solutions, if it is new and within limits.

    The first n joints move. Returns the number of solutions.
    """
    prismatic, lower, upper = chain.prismatic, chain.lower, chain.upper
    for k in range(configurations.shape[1]):
        value = q[0, k, lane]
        if k < n:
            if not prismatic[k]:
                endless = upper[k] - lower[k] >= TURN
                about = search.near[k] if endless else 0.5 * (lower[k] + upper[k])
                value -= TURN * nearest_whole((value - about) / TURN)
                if endless:
                    value -= TURN if value > upper[k] else 0.0
                    value += TURN if value < lower[k] else 0.0
            if value > upper[k] + ROUNDING or value < lower[k] - ROUNDING:
                return found
            value = min(max(value, lower[k]), upper[k])
        configurations[found, k] = value
    for other in range(found):
        apart = 0.0
        for k in range(n):
            difference = configurations[found, k] - configurations[other, k]
            if not prismatic[k] and upper[k] - lower[k] >= TURN:
                difference -= TURN * nearest_whole(difference / TURN)
            apart = max(apart, abs(difference))
        if apart <= search.separation:
            hits[other] += 1
            return found
    hits[found] = 1
    return found + 1


@kernel
def solve_targets(
    first: int,
    last: int,
    chain: Chain,
    search: Search,
    positions: Array,
    directions: Array,
    configurations: Array,
    counts: NDArray[np.int64],
) -> None:
    """Find the configurations of wanted tools, for rows of targets.

    Of solutions that differ by whole turns, the nearest to ``search.near`` is
    given.

    Parameters
    ----------
    first, last, chain, search
        Range of the rows, the arm, and the search.
    positions, directions : ndarray, shape (n_targets, 3) and (n_targets, n_axes, 3)
        Wanted tool points [m], and directions of the tool's axes.
    configurations : ndarray, shape (n_targets, most + 1, n_joints)
        Where solutions go [rad or m].
    counts : ndarray of int, shape (n_targets,)
        Where the numbers of solutions go.
    """
    prismatic = chain.prismatic
    n_joints, (n_seeds, n) = configurations.shape[2], search.seeds.shape
    most, n_axes, tool = configurations.shape[1] - 1, directions.shape[1], search.tool
    rows = 3 if n_axes == 0 else 6
    q = as_lanes(np.zeros((1, n_joints, LANES)))
    aim, wanted = as_lanes(np.zeros((3, LANES))), as_lanes(np.zeros((n_axes, 3, LANES)))
    iteration, error = as_lanes(np.zeros((1, LANES))), as_lanes(np.zeros((rows, LANES)))
    jacobian, step = as_lanes(np.zeros((rows, n, LANES))), as_lanes(np.zeros((n, LANES)))
    square, before = as_lanes(np.zeros((rows + 1, rows, LANES))), as_lanes(np.zeros((1, LANES)))
    poses = as_lanes(np.zeros((n_joints + 1, POSE, LANES)))
    numbers, iterations = as_numbers(q), as_numbers(iteration)
    lower, upper = chain.lower[:n], chain.upper[:n]
    lowest, highest = np.empty(n), np.empty(n)
    for k in range(n):
        # Solutions of a continuum are sought within the limits, isolated ones anywhere.
        turns = not prismatic[k] and (search.least > 0 or upper[k] - lower[k] >= TURN)
        lowest[k], highest[k] = (-math.inf, math.inf) if turns else (lower[k], upper[k])
    hits = np.zeros(most + 1, dtype=np.int64)
    farthest, widest = search.scale * search.position_tolerance, search.rotation_tolerance
    for target in range(first, last):
        for k in range(3):
            aim[k] = positions[target, k]
            for i in range(n_axes):
                wanted[i, k] = directions[target, i, k]
        found, tried, waiting, n_moving, free = 0, 0, 0, 0, (1 << LANES) - 1
        while True:
            # Put the next seeds into free lanes: first ``near``, then the others.
            for lane in range(LANES):
                if free >> lane & 1 and waiting < n_seeds + 1:
                    for k in range(n_joints):
                        numbers[0, k, lane] = search.near[k]
                        if k < n and waiting > 0:
                            share = search.seeds[waiting - 1, k]
                            numbers[0, k, lane] = lower[k] + share * (upper[k] - lower[k])
                    iterations[0, lane] = 0.0
                    waiting, n_moving, free = waiting + 1, n_moving + 1, free & ~(1 << lane)
            if n_moving == 0:
                break
            # Errors of position and orientation, and their Jacobian.
            forward_kinematics(chain, q, 0, poses)
            point = to_world(poses, n_joints, tool[0], tool[1], tool[2])
            point_jacobian(chain, poses, point, jacobian)
            squared = 0.0 * point[0]
            turned = 0.0 * point[0]
            for i in range(3):
                error[i] = search.scale * (aim[i] - point[i])
                squared += error[i] * error[i]
                for k in range(n):
                    jacobian[i, k] = search.scale * jacobian[i, k]
            moved = squared
            if n_axes > 0:
                turn = orientation_error(search.axes, poses, wanted, jacobian)
                for i in range(3):
                    error[3 + i] = turn[i]
                    squared += turn[i] * turn[i]
                    turned += turn[i] * turn[i]
            # A damped Newton step, without joints that it would push beyond a limit.
            arrived = squared <= PRECISION * PRECISION
            damping = DAMPING * squared + LEAST_DAMPING
            blocked = True
            while blocked:
                damped_step(jacobian, error, damping, square, step)
                blocked = take_out_blocked(q, lowest, highest, step, jacobian)
            # Take out what has arrived, a solution that may be new, and what is stuck.
            stuck = (iteration[0] >= PATIENCE) & (squared > PROGRESS * before[0])
            ended = arrived | stuck | (iteration[0] >= ITERATIONS)
            before[0] = squared
            close = (moved <= farthest * farthest) & (turned <= widest * widest)
            ended_bits = lane_bits(ended) & ~free
            arrived_bits = lane_bits(arrived | ended & close) & ~free
            for lane in range(LANES if ended_bits != 0 else 0):
                if ended_bits >> lane & 1:
                    tried, n_moving = tried + 1, n_moving - 1
                    if arrived_bits >> lane & 1 and found < most:
                        row = configurations[target]
                        found = keep_new(numbers, lane, search, chain, n, row, hits, found)
            free |= ended_bits
            # End with enough solutions, or when each was found often enough.
            if found == most:
                break
            if search.least > 0 and tried >= search.least and found > 0:
                fewest = HITS
                for solution in range(found):
                    fewest = min(fewest, hits[solution])
                if fewest == HITS:
                    break
            take_step(q, lowest, highest, step)
            iteration[0] += 1.0
        counts[target] = found


LONGEST_STEP = 0.5
"""Largest move of a joint in an iteration [rad or m]."""


@inlined
def take_out_blocked(q: Array, lower: Array, upper: Array, step: Array, jacobian: Array) -> bool:
    """Zero the Jacobian's columns of joints that would leave limits; tell if any."""
    blocked = False
    for k in range(step.shape[0]):
        outward = ((q[0, k] >= upper[k]) & (step[k] > 0.0)) | (
            (q[0, k] <= lower[k]) & (step[k] < 0.0)
        )
        if any_lane(outward):
            blocked = True
            for i in range(jacobian.shape[0]):
                jacobian[i, k] = select(outward, 0.0, jacobian[i, k])
    return blocked


@inlined
def take_step(q: Array, lower: Array, upper: Array, step: Array) -> None:
    """Move configurations by a step within the limits."""
    # Scaled as a whole, a step keeps its direction.
    longest = 0.0 * step[0] + LONGEST_STEP
    for k in range(step.shape[0]):
        longest = max(longest, abs(step[k]))
    for k in range(step.shape[0]):
        moved = q[0, k] + LONGEST_STEP / longest * step[k]
        q[0, k] = min(max(moved, lower[k]), upper[k])
