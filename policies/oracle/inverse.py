"""Inverse kinematics: contact-free configurations at a goal."""

from decimal import Context, Decimal
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm._parallel import run_rows
from kinarm.kernels.compiling import Array
from kinarm.kernels.records import recorded
from kinarm.policies.oracle.goals import Aims
from kinarm.policies.oracle.kernels.projection import damped_least_squares, layout
from kinarm.randomness import low_discrepancy_points
from kinarm.simulator import Simulator

RESERVE = 1e-6
"""Share of the tolerance kept against rounding."""


class Solutions(NamedTuple):
    """Contact-free configurations at goals, shape (m, n_joints), and the goals' rows."""

    configurations: Array
    owner: NDArray[np.int64]


def solve_within(
    simulator: Simulator,
    starts: Array,
    goals: Array,
    steps: NDArray[np.int64],
    tolerance: float | Array,
    guesses: Array,
    samples: int,
) -> Solutions:
    """Find contact-free configurations close to goals within some steps.

    Parameters
    ----------
    simulator : Simulator
        Arm and scene.
    starts, guesses : ndarray, shape (m, n_joints)
        Where the arm is, and likely solutions [rad or m].
    goals : ndarray, shape (m, goal_width)
        The goals, their positions first [m].
    steps, tolerance : ndarray of int, shape (m,), and float or ndarray, shape (m,)
        Most steps from the starts, and largest distance from the goals [m];
        rotations have a tolerance in the same ratio to the task's.
    samples : int
        Configurations to begin from: start, guess, and evenly spread ones.
    """
    m, n_joints = len(starts), simulator.arm.n_joints
    aims = Aims.of(simulator, starts, goals, -RESERVE * simulator.world.rules.goal.tolerance)
    lower, upper = step_box(simulator, starts, steps)
    box = np.fmax(lower, aims.lower), np.fmin(upper, aims.upper)
    empty = np.any(box[0] > box[1], axis=1)
    spread, shares = _beginnings(samples, simulator.n_actions)
    lower, upper, moved = box[0][:, None], box[1][:, None], slice(simulator.n_actions)
    beginnings = np.repeat(starts[:, None], samples, axis=1)
    beginnings[:, :, moved] = lower + spread * (upper - lower)
    beginnings[:, 1 % samples] = guesses
    beginnings[:, 0] = starts
    beginnings[:, :, moved] = np.clip(beginnings[:, :, moved], lower, upper)
    owner = np.repeat(np.arange(m), samples)
    allowed = np.full(m, tolerance * (1.0 - RESERVE))[owner]
    radius, configurations = allowed * np.tile(shares, m), beginnings.reshape(-1, n_joints)
    distances, wanted = np.empty(len(owner)), (aims.position, recorded(aims.turn), aims.wanted)
    arrays = (simulator.world.records[0], owner, *box, *wanted, radius, configurations, distances)

    def project_some(first: int, last: int) -> None:
        moving = layout(n_joints, simulator.n_actions, len(aims.turn.axes)).record()
        damped_least_squares(first, last, moving, *arrays)

    run_rows(project_some, len(owner), 4 * len(owner), simulator.threads)
    near = np.flatnonzero((distances <= allowed) & ~empty[owner])
    _, touching = simulator.world.screen(configurations[near])
    free = near[~touching]
    return Solutions(configurations[free], owner[free])


@cache
def _beginnings(samples: int, n: int) -> tuple[Array, Array]:
    """Even points of n joints, and shares of the tolerance at which they may end.

    Half of them may rest on the rim of the ball, the others within.
    """
    points, context = low_discrepancy_points(samples, n + 1), Context(prec=28)
    third = context.divide(Decimal(1), Decimal(3))
    # The cube root of floats would come from other libraries on other machines.
    within = [float(context.power(Decimal(share), third)) for share in points[:, -1].tolist()]
    return points[:, :-1], np.where(np.arange(samples) % 2 == 0, 1.0, within)


def step_box(simulator: Simulator, starts: Array, steps: NDArray[np.int64]) -> tuple[Array, Array]:
    """Corners of what joints can reach in some steps.

    Parameters
    ----------
    simulator : Simulator
        The arm, its limits and its step.
    starts : ndarray, shape (m, n_joints)
        Where the arm is [rad or m].
    steps : ndarray of int, shape (m,)
        Steps at most.

    Returns
    -------
    tuple of ndarray, shape (m, n_actions)
        The lower and the upper corners [rad or m].
    """
    moved = slice(simulator.n_actions)
    extent = steps[:, None] * simulator.step_limit
    lower = np.maximum(simulator.arm.lower[moved], starts[:, moved] - extent)
    upper = np.minimum(simulator.arm.upper[moved], starts[:, moved] + extent)
    return lower, upper


def steps_between(simulator: Simulator, first: Array, second: Array) -> Array:
    """Steps of straight motions between configurations, shape (...), before rounding up.

    The slowest actuated joint decides: the largest of |dq_i| / (rate_i dt). Configurations have the
    shape (..., n_joints) [rad or m].
    """
    moved = np.abs(second - first)[..., : simulator.n_actions] / simulator.step_limit
    steps: Array = moved.max(axis=-1)
    return steps
