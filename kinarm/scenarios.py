"""Scenarios: where an episode starts and what it has to reach."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kinarm.errors import ProblemError
from kinarm.kernels.starting import propose_starts, rejected_rows
from kinarm.world import World

START_ATTEMPTS = 2000
PREFETCHED = 32


def draw_scenarios(
    world: World, rng: np.random.Generator, count: int, *, start_spread: float | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Draw starts and goals.

    Goals are uniform over the task's regions. Each actuated joint starts uniformly within its
    limits, scaled by the start spread, or the arm starts at one of the task's configurations;
    starts are rejected until the arm touches nothing and its tool is farther from the goal than
    the tolerance.

    Parameters
    ----------
    world : World
        The world of the problem.
    rng : numpy.random.Generator
        Source of randomness.
    count : int
        How many.
    start_spread : float, optional
        Instead of the task's.

    Returns
    -------
    starts : ndarray, shape (count, n_joints)
        Configurations [rad or m].
    goals : ndarray, shape (count, 3)
        Goal positions [m].

    Raises
    ------
    ProblemError
        If no acceptable start is found for some goal in 2000 attempts.
    """
    starts, goals = draw_for_each(world, [rng], count, start_spread=start_spread)
    return starts[0], goals[0]


def draw_for_each(
    world: World,
    rngs: Sequence[np.random.Generator],
    count: int,
    *,
    start_spread: float | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Draw starts and goals from several generators, which are screened together.

    Each generator is asked for the same numbers as by `draw_scenarios`.

    Parameters
    ----------
    world, count, start_spread
        As for `draw_scenarios`.
    rngs : sequence of numpy.random.Generator
        Sources of randomness.

    Returns
    -------
    starts : ndarray, shape (n_rngs, count, n_joints)
        Configurations [rad or m].
    goals : ndarray, shape (n_rngs, count, 3)
        Goal positions [m].
    """
    arm, task, n_actions = world.arm, world.problem.task, world.n_actions
    spread = task.start_spread if start_spread is None else start_spread
    lower = arm.home + spread * (arm.lower - arm.home)
    extent = spread * (arm.upper - arm.lower)
    listed = np.array(task.starts)
    goals = np.concatenate([task.draw_goals(world.problem.scene, rng, count) for rng in rngs])
    starts = np.tile(arm.home, (len(goals), 1))
    pending = np.arange(len(goals))
    for _ in range(START_ATTEMPTS):
        wanted = np.bincount(pending // max(count, 1), minlength=len(rngs)).tolist()
        drawn = [rng.random((n, n_actions)) for rng, n in zip(rngs, wanted, strict=True)]
        uniforms = np.concatenate(drawn)
        if len(listed):
            starts[pending] = proposed = listed[(uniforms[:, 0] * len(listed)).astype(np.int64)]
        else:
            proposed = propose_starts(pending, uniforms, lower, extent, starts)
        tools, touching = world.screen(proposed)
        pending = rejected_rows(pending, goals, tools, touching, task.tolerance)
        if pending.size == 0:
            return starts.reshape(len(rngs), count, arm.n_joints), goals.reshape(
                len(rngs), count, 3
            )
    pair = world.contact_model.contact_pair(starts[pending[0]])
    reason = f"{pair[0]} touches {pair[1]}" if pair else "the tool already is at the goal"
    source = "from task.starts" if len(listed) else f"with start_spread {spread}"
    raise ProblemError(
        f"no contact-free start away from the goal found in {START_ATTEMPTS} attempts for arm "
        f"{arm.name!r} {source}; in the last one {reason}"
    )


class ScenarioStream:
    """Starts and goals of successive episodes, drawn a few at a time."""

    def __init__(self, world: World, rng: np.random.Generator) -> None:
        self._world = world
        self._rng = rng
        self._ready: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []

    def next(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return a start, shape (n_joints,), and a goal, shape (3,)."""
        if not self._ready:
            starts, goals = draw_scenarios(self._world, self._rng, PREFETCHED)
            self._ready = list(zip(starts, goals, strict=True))[::-1]
        return self._ready.pop()
