"""Inverse kinematics: configurations that bring the tool to a goal without contact.

Kinematics and Jacobian are those of the Pinocchio model, flattened for the compiled kernels.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm._parallel import run_rows
from kinarm._validation import finite_array, whole_number
from kinarm.errors import InvalidInputError
from kinarm.policies.oracle.kernels.projection import damped_least_squares, layout
from kinarm.policies.oracle.motion import steps_between
from kinarm.randomness import low_discrepancy_points
from kinarm.simulator import Simulator

RESERVE = 1e-6
"""Share of the tolerance that is left against rounding."""


class Solutions(NamedTuple):
    """Configurations at which the tool is within the tolerance of a goal and nothing touches.

    Attributes
    ----------
    configurations : ndarray, shape (m, n_joints)
        In the order of their owners [rad or m].
    owner : ndarray of int, shape (m,)
        Which goal they belong to.
    """

    configurations: NDArray[np.float64]
    owner: NDArray[np.int64]


def inverse_kinematics(
    simulator: Simulator,
    start: ArrayLike,
    goal: ArrayLike,
    *,
    samples: int = 1024,
    separation: float = 0.2,
) -> NDArray[np.float64]:
    """Find the distinct contact-free configurations that reach a goal within the horizon.

    Evenly spread configurations and the current one are moved into the ball about the goal by
    damped least squares within the limits. An arm with more joints than a position has coordinates
    has a continuum of solutions: those returned differ from each other.

    Parameters
    ----------
    simulator : Simulator
        Arm, scene and tolerance.
    start : array_like, shape (n_joints,)
        Current configuration; axes that are not actuated stay there [rad or m].
    goal : array_like, shape (3,)
        Goal position [m].
    samples : int
        Configurations to begin with.
    separation : float
        Least difference of two solutions in some axis [rad or m].

    Returns
    -------
    ndarray, shape (k, n_joints)
        The solution that takes the fewest steps first [rad or m]; k may be 0.

    Raises
    ------
    InvalidInputError
        If a shape is wrong, an entry is not finite, the start is beyond the limits or a number
        is not positive.
    """
    q = finite_array("start", start, (simulator.arm.n_joints,))
    g = finite_array("goal", goal, (3,))
    starts, goals = simulator.check_scenarios(q[None], g[None])
    horizon, tolerance = np.array([simulator.task.horizon]), np.array([simulator.task.tolerance])
    samples = whole_number("samples", samples, 1)
    if not separation > 0:
        raise InvalidInputError(f"separation must be greater than 0, got {separation}")
    found, _ = solve_within(simulator, starts, goals, horizon, tolerance, starts, samples)
    remaining = found[np.argsort(steps_between(simulator, starts, found), kind="stable")]
    distinct = []
    while len(remaining):
        distinct.append(remaining[0])
        remaining = remaining[np.abs(remaining - remaining[0]).max(axis=1) > separation]
    return np.array(distinct).reshape(-1, simulator.arm.n_joints)


def solve_within(
    simulator: Simulator,
    starts: NDArray[np.float64],
    goals: NDArray[np.float64],
    steps: NDArray[np.int64],
    tolerances: NDArray[np.float64],
    guesses: NDArray[np.float64],
    samples: int,
) -> Solutions:
    """Find contact-free configurations close to goals that are at most some steps away.

    Row by row: the tool within ``tolerances`` of ``goals`` [m], and ``steps`` or fewer from
    ``starts``. The search begins at as many ``samples``: the start, the guess, and evenly spread
    configurations.

    Parameters
    ----------
    simulator : Simulator
        Arm and scene.
    starts, guesses : ndarray, shape (m, n_joints)
        Where the arm is, and configurations that may be close to a solution [rad or m].
    goals : ndarray, shape (m, 3)
        Goal positions [m].
    steps : ndarray of int, shape (m,)
        Steps at most from the starts.
    tolerances : ndarray, shape (m,)
        Distances at most from the goals [m].
    samples : int
        Configurations from which each search begins.
    """
    m, n_joints = len(starts), simulator.arm.n_joints
    box = step_box(simulator, starts, steps)
    spread = low_discrepancy_points(samples, simulator.n_actions + 1)
    lower, upper, moved = box[0][:, None], box[1][:, None], slice(simulator.n_actions)
    beginnings = np.repeat(starts[:, None], samples, axis=1)
    beginnings[:, :, moved] = lower + spread[:, :-1] * (upper - lower)
    beginnings[:, 1 % samples] = guesses
    beginnings[:, 0] = starts
    beginnings[:, :, moved] = np.clip(beginnings[:, :, moved], lower, upper)
    # Half of the solutions may rest on the rim of the ball, the others lie throughout it.
    shares = np.where(np.arange(samples) % 2 == 0, 1.0, np.cbrt(spread[:, -1]))
    owner = np.repeat(np.arange(m), samples)
    allowed = (tolerances * (1.0 - RESERVE))[owner]
    radius = allowed * np.tile(shares, m)
    configurations, distances = project(
        simulator, beginnings.reshape(-1, n_joints), owner, box, goals, radius
    )
    near = np.flatnonzero(distances <= allowed)
    _, touching = simulator.world.screen(configurations[near])
    free = near[~touching]
    return Solutions(configurations[free], owner[free])


def project(
    simulator: Simulator,
    configurations: NDArray[np.float64],
    owner: NDArray[np.int64],
    box: tuple[NDArray[np.float64], NDArray[np.float64]],
    goals: NDArray[np.float64],
    radius: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Move configurations towards goals by damped least squares; contact is ignored.

    Returns where they ended [rad or m], and the distances from tool to goal [m]. ``owner`` says
    which row of the box's corners and of the goals belongs to each, and ``radius`` how far from
    the goal it may rest [m].

    Parameters
    ----------
    simulator : Simulator
        The arm.
    configurations : ndarray, shape (k, n_joints)
        Where they begin [rad or m].
    owner : ndarray of int, shape (k,)
        Rows of the box and of the goals that they belong to.
    box : tuple of ndarray, shape (m, n_actions)
        Lower and upper corners, which they do not leave [rad or m].
    goals : ndarray, shape (m, 3)
        Goal positions [m].
    radius : ndarray, shape (k,)
        How far from the goal they may rest [m].
    """
    ended, distances = configurations.copy(), np.empty(len(configurations))
    chain, _, _ = simulator.world.records
    arrays = (chain, owner, *box, goals, radius, ended, distances)
    run_rows(_project_some, len(ended), 4 * len(ended), simulator.threads, *arrays)
    return ended, distances


def _project_some(first: int, last: int, *arrays: Any) -> None:
    """Move some of the configurations, with work space that no other thread uses."""
    chain, _, lower = arrays[:3]
    moving = layout(len(chain.lower), lower.shape[1]).record()
    damped_least_squares(first, last, moving, *arrays)


def step_box(
    simulator: Simulator, starts: NDArray[np.float64], steps: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners of what the actuated joints can reach in some steps, shapes (m, n_actions).

    Parameters
    ----------
    simulator : Simulator
        The arm and its step.
    starts : ndarray, shape (m, n_joints)
        Where it is [rad or m].
    steps : ndarray of int, shape (m,)
        How many.
    """
    moved = slice(simulator.n_actions)
    extent = steps[:, None] * simulator.step_limit
    lower = np.maximum(simulator.arm.lower[moved], starts[:, moved] - extent)
    upper = np.minimum(simulator.arm.upper[moved], starts[:, moved] + extent)
    return lower, upper
