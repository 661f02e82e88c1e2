"""Scenarios: where an episode starts and what it has to reach."""

from collections.abc import Sequence

import numpy as np

from kinarm.errors import ProblemError
from kinarm.kernels.compiling import Array
from kinarm.kernels.screening import propose_starts, rejected_rows
from kinarm.world import World

START_ATTEMPTS = 2000
PREFETCHED = 32
"""Scenarios that are drawn at a time for the successive episodes of an arm."""


def draw_scenarios(
    world: World, rng: np.random.Generator, count: int, *, start_spread: float | None = None
) -> tuple[Array, Array]:
    """Draw starts, shape (count, n_joints) [rad or m], and goals, shape (count, 3) [m].

    Goals are uniform over the task's regions. Each actuated joint starts uniformly within its
    limits, scaled by the start spread, or the arm starts at one of the task's configurations;
    starts are rejected until the arm touches nothing and its tool is farther from the goal than
    the tolerance. After 2000 attempts that is a `kinarm.ProblemError`.

    Parameters
    ----------
    world, rng, count
        The world of the problem, source of randomness, and how many.
    start_spread : float, optional
        Instead of the task's.
    """
    starts, goals = draw_for_each(world, [rng], count, start_spread=start_spread)
    return starts[0], goals[0]


def draw_for_each(
    world: World,
    rngs: Sequence[np.random.Generator],
    count: int,
    *,
    start_spread: float | None = None,
) -> tuple[Array, Array]:
    """Draw starts and goals from several generators, which are screened together.

    Each generator is asked for the same numbers as by `draw_scenarios`; starts and goals have a
    further first axis, of the generators.

    Parameters
    ----------
    world, count, start_spread
        As for `draw_scenarios`.
    rngs : sequence of numpy.random.Generator
        Sources of randomness.
    """
    arm, task, n_actions = world.arm, world.problem.task, world.n_actions
    spread = task.start_spread if start_spread is None else start_spread
    lower = arm.home + spread * (arm.lower - arm.home)
    extent = spread * (arm.upper - arm.lower)
    goals = world.goals.at(_draw(rngs, [count] * len(rngs), 1 + len(world.goals.moving)))
    listed = np.array(task.starts)
    starts = np.empty((len(goals), arm.n_joints))
    starts[:] = arm.home
    pending = np.arange(len(goals))
    for _ in range(START_ATTEMPTS):
        wanted = [len(pending)]
        if len(rngs) > 1:
            wanted = np.bincount(pending // max(count, 1), minlength=len(rngs)).tolist()
        uniforms = _draw(rngs, wanted, n_actions)
        if len(listed):
            starts[pending] = proposed = listed[(uniforms[:, 0] * len(listed)).astype(np.int64)]
        else:
            proposed = propose_starts(pending, uniforms, lower, extent, starts)
        tools, touching = world.screened(proposed)
        pending = rejected_rows(pending, goals, tools, touching, task.tolerance)
        if pending.size == 0:
            shape = len(rngs), count
            return starts.reshape(*shape, arm.n_joints), goals.reshape(*shape, 3)
    pair = world.contact_model.contact_pair(starts[pending[0]])
    reason = f"{pair[0]} touches {pair[1]}" if pair else "the tool already is at the goal"
    drawn_from = "from task.starts" if len(listed) else f"with start_spread {spread}"
    raise ProblemError(
        f"no contact-free start away from the goal found in {START_ATTEMPTS} attempts for arm "
        f"{arm.name!r} {drawn_from}; in the last one {reason}"
    )


def _draw(rngs: Sequence[np.random.Generator], counts: Sequence[int], width: int) -> Array:
    """Draw rows of numbers in [0, 1), so many from each generator."""
    if len(rngs) == 1:
        return rngs[0].random((counts[0], width))
    uniforms, first = np.empty((sum(counts), width)), 0
    for rng, count in zip(rngs, counts, strict=True):
        if count:
            rng.random(out=uniforms[first : first + count])
        first += count
    return uniforms
