"""Scenarios: where an episode starts and what it has to reach."""

from collections.abc import Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from kinarm.errors import ProblemError
from kinarm.kernels.screening import propose_starts, rejected_rows
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
    source = rngs[0] if len(rngs) == 1 else cast("np.random.Generator", _Sources(rngs))
    goals = world.goals.draw(source, count * len(rngs))
    listed = np.array(task.starts)
    starts = np.empty((len(goals), arm.n_joints))
    starts[:] = arm.home
    pending = np.arange(len(goals))
    for _ in range(START_ATTEMPTS):
        uniforms = _draw_uniforms(rngs, pending // max(count, 1), n_actions)
        if len(listed):
            starts[pending] = proposed = listed[(uniforms[:, 0] * len(listed)).astype(np.int64)]
        else:
            proposed = propose_starts(pending, uniforms, lower, extent, starts)
        tools, touching = world.screened(proposed)
        pending = rejected_rows(pending, goals, tools, touching, task.tolerance)
        if pending.size == 0:
            return starts.reshape(len(rngs), count, arm.n_joints), goals.reshape(
                len(rngs), count, 3
            )
    pair = world.contact_model.contact_pair(starts[pending[0]])
    reason = f"{pair[0]} touches {pair[1]}" if pair else "the tool already is at the goal"
    drawn_from = "from task.starts" if len(listed) else f"with start_spread {spread}"
    raise ProblemError(
        f"no contact-free start away from the goal found in {START_ATTEMPTS} attempts for arm "
        f"{arm.name!r} {drawn_from}; in the last one {reason}"
    )


class _Sources:
    """Generators that are asked for equal shares of numbers, as if they were one."""

    def __init__(self, rngs: Sequence[np.random.Generator]) -> None:
        self._rngs = rngs

    def random(self, shape: tuple[int, ...]) -> NDArray[np.float64]:
        """Draw numbers in [0, 1), the first rows with the first generator."""
        numbers = np.empty((len(self._rngs), shape[0] // len(self._rngs), *shape[1:]))
        for rng, own in zip(self._rngs, numbers, strict=True):
            rng.random(out=own)
        return numbers.reshape(shape)


def _draw_uniforms(
    rngs: Sequence[np.random.Generator], askers: NDArray[np.int64], n_actions: int
) -> NDArray[np.float64]:
    """Draw a row of numbers in [0, 1) from the generator of each asker, who come in order."""
    if len(rngs) == 1:
        return rngs[0].random((len(askers), n_actions))
    uniforms, first = np.empty((len(askers), n_actions)), 0
    for rng, wanted in zip(rngs, np.bincount(askers, minlength=len(rngs)).tolist(), strict=True):
        if wanted:
            rng.random(out=uniforms[first : first + wanted])
        first += wanted
    return uniforms


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
