"""Scenarios: starts and goals of episodes."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kinarm.errors import ProblemError, whole_number
from kinarm.kernels.compiling import Array
from kinarm.world import World

START_ATTEMPTS = 2000
PREFETCHED = 32
"""Scenarios drawn at a time for the episodes of an arm."""


def draw_scenarios(
    world: World, rng: np.random.Generator, count: int, *, start_spread: float | None = None
) -> tuple[Array, Array]:
    """Draw starts, shape (count, n_joints) [rad or m], and goals, shape (count, 3) [m].

    Goals are uniform over the task's regions. Each actuated joint starts
    uniformly within its limits, scaled by the start spread, or the arm starts
    at one of the task's configurations, without contact and farther from the
    goal than the tolerance. If the task asks for it, goals without a free
    configuration are drawn again. If none is found in 2000 attempts, that is
    a `kinarm.ProblemError`.

    Parameters
    ----------
    world, rng, count
        World of the problem, source of randomness, and number.
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
    """Draw starts and goals from several generators, and screen them together.

    Generators give the same numbers as in `draw_scenarios`, along a further
    first axis.

    Parameters
    ----------
    world, count, start_spread
        As for `draw_scenarios`.
    rngs : sequence of numpy.random.Generator
        Sources of randomness.
    """
    whole_number("count", count, 0)
    arm, task, n_actions = world.arm, world.problem.task, world.n_actions
    spread = task.start_spread if start_spread is None else start_spread
    lower = (arm.home + spread * (arm.lower - arm.home))[:n_actions]
    extent = (spread * (arm.upper - arm.lower))[:n_actions]
    width = 1 + len(world.goals.moving)
    goals = world.goals.at(_draw(rngs, [count] * len(rngs), width))
    listed = world.starts
    starts = np.tile(arm.home, (len(goals), 1))
    pending = np.arange(len(goals))
    for _ in range(START_ATTEMPTS):
        wanted = [len(pending)]
        if len(rngs) > 1:
            wanted = np.bincount(pending // max(count, 1), minlength=len(rngs)).tolist()
        uniforms, aims = _draw(rngs, wanted, n_actions), goals[pending]
        if len(listed):
            starts[pending] = listed[(uniforms[:, 0] * len(listed)).astype(np.int64)]
        else:
            starts[pending, :n_actions] = lower + uniforms * extent
        proposed = starts[pending]
        tools, touching = world.screened(proposed, world.scenes_of(proposed, aims))
        x, y, z = (tools - aims).T
        rejected = touching | (np.sqrt(x * x + y * y + z * z) <= task.tolerance)
        if task.reachable_goals:
            missed = ~rejected
            missed[missed] = ~have_solutions(world, proposed[missed], aims[missed])
            rows = pending[missed]
            wanted = np.bincount(rows // max(count, 1), minlength=len(rngs)).tolist()
            goals[rows] = world.goals.at(_draw(rngs, wanted, width))
            rejected |= missed
        pending = pending[rejected]
        if pending.size == 0:
            shape = len(rngs), count
            return starts.reshape(*shape, arm.n_joints), goals.reshape(*shape, 3)
    pair = world.contact_model.contact_pair(starts[pending[0]])
    reason = f"{pair[0]} touches {pair[1]}" if pair else "the tool already is at the goal"
    if task.reachable_goals and missed.any():
        reason = "nothing free of contact is found at the goal"
    drawn_from = "from task.starts" if len(listed) else f"with start_spread {spread}"
    raise ProblemError(
        f"no contact-free start away from the goal found in {START_ATTEMPTS} attempts for arm "
        f"{arm.name!r} {drawn_from}; in the last one {reason}"
    )


SOLUTIONS = (4, 64)
"""Configurations at a goal that are tried in turn."""


def have_solutions(world: World, starts: Array, goals: Array) -> NDArray[np.bool_]:
    """Whether inverse kinematics finds what touches nothing at the goals of scenarios.

    Takes starts, shape (n, n_joints) [rad or m], which decide about scenes, and goals, shape (n, 3)
    [m].
    """
    found, scenes = np.zeros(len(goals), dtype=bool), world.scenes_of(starts, goals)
    for most in SOLUTIONS:
        rows = np.flatnonzero(~found)
        solutions = world.inverse_kinematics(goals[rows], most=most)
        owner = rows[solutions.owner]
        there = scenes[owner] if len(scenes) else scenes
        _, touching = world.screened(np.ascontiguousarray(solutions.configurations), there)
        found[owner[~touching]] = True
    return found


def _draw(rngs: Sequence[np.random.Generator], counts: Sequence[int], width: int) -> Array:
    """Draw rows of numbers in [0, 1), so many of each generator."""
    if len(rngs) == 1:
        return rngs[0].random((counts[0], width))
    uniforms, first = np.empty((sum(counts), width)), 0
    for rng, count in zip(rngs, counts, strict=True):
        if count:
            rng.random(out=uniforms[first : first + count])
        first += count
    return uniforms


class ScenarioQueues:
    """Starts and goals of the episodes of many arms, drawn together.

    An arm's are those of `draw_scenarios` with its generator, a few at a time. There is room for
    two draws: once an arm has no scenario left, all with room get more.
    """

    def __init__(self, world: World, n_arms: int) -> None:
        self._world, self._rngs = world, [np.random.default_rng() for _ in range(n_arms)]
        self._starts = np.empty((n_arms, 2 * PREFETCHED, world.arm.n_joints))
        self._goals = np.empty((n_arms, 2 * PREFETCHED, 3))
        self._taken, self._drawn = np.zeros((2, n_arms), dtype=np.int64)

    def seed(self, row: int, rng: np.random.Generator) -> None:
        """Give an arm another generator, and forget its drawn scenarios."""
        self._rngs[row] = rng
        self._taken[row] = self._drawn[row] = 0

    def put(self, rows: NDArray[np.int64], q: Array, goal: Array) -> None:
        """Put the next scenarios of some arms into their rows.

        Parameters
        ----------
        rows, q, goal
            The arms, and configurations [rad or m] and goals [m] of all arms.
        """
        taken = self._taken[rows]
        if (taken == self._drawn[rows]).any():
            self._draw()
        places = taken % (2 * PREFETCHED)
        q[rows], goal[rows] = self._starts[rows, places], self._goals[rows, places]
        self._taken[rows] = taken + 1

    def _draw(self) -> None:
        """Draw scenarios for all arms with room."""
        rows = (self._drawn - self._taken <= PREFETCHED).nonzero()[0]
        rngs = [self._rngs[row] for row in rows.tolist()]
        places = (self._drawn[rows, None] + np.arange(PREFETCHED)) % (2 * PREFETCHED)
        drawn = draw_for_each(self._world, rngs, PREFETCHED)
        self._starts[rows[:, None], places], self._goals[rows[:, None], places] = drawn
        self._drawn[rows] += PREFETCHED
