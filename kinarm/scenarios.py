"""Scenarios: starts and goals of episodes.

A goal may be a configuration that the arm is to take: one that control without a network reaches.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from kinarm._parallel import run_together
from kinarm.episode_draws import bits_of, scenes_at
from kinarm.episodes import LINEAR, SUCCESS, Control
from kinarm.errors import ProblemError, whole_number
from kinarm.goal_kinematics import SAMPLE
from kinarm.kernels.compiling import Array
from kinarm.kernels.rollout import advance, begin
from kinarm.plant import Plant
from kinarm.world import World

START_ATTEMPTS = 2000
PREFETCHED = 32
"""Scenarios drawn at a time for the episodes of an arm."""

CANDIDATES = ((16, 256), (96, 1024), (384, 4096))
"""Configurations at a goal that are tried in turn, and the seeds that look for them, at most."""

STRAIGHT = 12
"""Points at which the straight way to a configuration is looked at."""

LOTS = (1, 8)
"""How many of these control has tried after each lot but the last, which has all others."""

PACES = (2, 1)
"""Steps of an episode in one of a try: first few long ones, and where these get there, all."""

AT_ONCE = 512
"""Goals at once: each may take a few megabytes."""


def draw_scenarios(
    world: World, rngs: Sequence[np.random.Generator], count: int
) -> tuple[Array, Array]:
    """Draw starts [rad or m] and goals from several generators, and screen them together.

    Starts have the shape (n_rngs, count, n_joints), and goals (n_rngs, count, goal_width). Goals
    are uniform over the task's regions, with rests as the task says. Each actuated joint starts
    uniformly within its limits, scaled by the start spread, or the arm starts at one of the task's
    configurations, without contact and farther from the goal's position than the tolerance. If the
    task asks for it, goals without a free configuration are drawn again. If none is found in 2000
    attempts, that is a `kinarm.ProblemError`. `kinarm.World.free` says what counts as free.

    Parameters
    ----------
    world, rngs, count
        World of the problem, sources of randomness, and number from each.
    """
    whole_number("count", count, 0)
    arm, task, n_actions = world.arm, world.problem.task, world.n_actions
    spread = task.start_spread
    lower = (arm.home + spread * (arm.lower - arm.home))[:n_actions]
    extent = (spread * (arm.upper - arm.lower))[:n_actions]
    width, solved = world.goals.n_uniforms, task.reachable_goals or world.goals.solved
    by_ways = task.goal.kind == "configuration" and not task.goal.configurations
    drawn = _draw(rngs, [count] * len(rngs), width)
    goals = world.goals.at(drawn)
    if task.goal.number and not world.reachable_of_sample:
        raise ProblemError(
            f"0 of a sample of {SAMPLE} goals can be reached: arm {arm.name!r} with "
            f"{arm.n_actuated} actuated joints finds no such {task.goal.kind} free of contact"
        )
    listed = world.starts
    starts = np.tile(arm.home, (len(goals), 1))
    pending = np.arange(len(goals))
    for _ in range(START_ATTEMPTS):
        wanted = np.bincount(pending // max(count, 1), minlength=len(rngs)).tolist()
        uniforms, aims = _draw(rngs, wanted, n_actions), goals[pending]
        if len(listed):
            starts[pending] = listed[(uniforms[:, 0] * len(listed)).astype(np.int64)]
        else:
            starts[pending, :n_actions] = lower + uniforms * extent
        proposed = starts[pending]
        scenes = world.scenes_of(proposed, aims)
        tools, free = world.free(proposed, scenes)
        x, y, z = (tools - aims[:, :3]).T
        rejected = ~free | (np.sqrt(x * x + y * y + z * z) <= task.tolerance)
        if solved:
            missed = ~rejected
            tried = pending[missed]
            there = scenes_at(scenes, missed)
            if by_ways:
                found, goals[tried] = solved_by_ways(world, aims[missed], proposed[missed], there)
            else:
                found, goals[tried] = world.solved_goals(aims[missed], drawn[tried, -1], there)
            missed[missed] = ~found
            rows = pending[missed]
            wanted = np.bincount(rows // max(count, 1), minlength=len(rngs)).tolist()
            drawn[rows] = _draw(rngs, wanted, width)
            goals[rows] = world.goals.at(drawn[rows])
            rejected |= missed
        pending = pending[rejected]
        if pending.size == 0:
            shape = len(rngs), count
            return starts.reshape(*shape, arm.n_joints), goals.reshape(*shape, world.goal_width)
    start, goal = starts[pending[0]], goals[pending[0]]
    pair = world.in_scene(start, goal).contact_pair(start)
    reason = f"{pair[0]} touches {pair[1]}" if pair else "the tool already is at the goal"
    if solved and missed.any():
        reason = "nothing free of contact is found at the goal"
    drawn_from = "from task.starts" if len(listed) else f"with start_spread {spread}"
    raise ProblemError(
        f"no contact-free start away from the goal found in {START_ATTEMPTS} attempts for arm "
        f"{arm.name!r} {drawn_from}; in the last one {reason}"
    )


def draw_followers(world: World, starts: Array, goals: Array) -> Array:
    """Goals of episodes in turn, shape (n, n_goals, goal_width), of which the first is given.

    The others follow from the bits of starts and first goals. Each is out of the tolerances of the
    one before.

    Parameters
    ----------
    world, starts, goals
        The world, starts, shape (n, n_joints) [rad or m], and first goals, shape (n, goal_width).
    """
    task = world.problem.task
    drawn = np.repeat(goals[:, None], task.goal.count, axis=1)
    bits = bits_of(starts, goals).tolist()
    rngs, scenes = [np.random.default_rng(row) for row in bits], world.scenes_of(starts, goals)
    pending = np.zeros(drawn.shape[:2], dtype=bool)
    pending[:, 1:] = True
    for _ in range(START_ATTEMPTS):
        owner = pending.nonzero()[0]
        if not owner.size:
            return drawn
        uniforms = _draw(rngs, pending.sum(axis=1).tolist(), world.goals.n_uniforms)
        found, aims = np.ones(len(owner), dtype=bool), world.goals.at(uniforms)
        if task.reachable_goals or world.goals.solved:
            there = scenes_at(scenes, owner)
            found, aims = world.solved_goals(aims, uniforms[:, -1], there)
        drawn[pending] = aims
        pending[pending] = ~found
        pending[:, 1:] |= world.at_goals(drawn[:, :-1], drawn[:, 1:])
    raise ProblemError(f"no goals of a sequence found in {START_ATTEMPTS} attempts")


def _draw(rngs: Sequence[np.random.Generator], counts: Sequence[int], width: int) -> Array:
    """Draw rows of numbers in [0, 1), so many of each generator."""
    uniforms, first = np.empty((sum(counts), width)), 0
    for rng, count in zip(rngs, counts, strict=True):
        rng.random(out=uniforms[first : first + count])
        first += count
    return uniforms


def solved_by_ways(
    world: World, goals: Array, starts: Array, scenes: Array
) -> tuple[NDArray[np.bool_], Array]:
    """Which goals have a configuration without contact; and goals with such configurations.

    Of up to 384, the first that control reaches (see `reached_by_control`) in steps twice as long
    and in the episode's own is taken: those first to which the straight way touches least, and then
    those that take least time. If there is none, it is the first that control reaches in long
    steps, or else the first of all.

    Parameters
    ----------
    world : World
        The world of the problem.
    goals, starts, scenes : ndarray
        Goals, shape (n, goal_width), starts, shape (n, n_joints) [rad or m], and the scenes of
        `kinarm.World.scenes_of`.
    """
    filled, found = goals.copy(), np.zeros(len(goals), dtype=bool)
    # How many of the paces control gets there in.
    ahead, reached = [_ahead(world, pace) for pace in PACES], np.zeros(len(goals), dtype=np.int64)
    for start in range(0, len(goals), AT_ONCE):
        pending = np.arange(start, min(start + AT_ONCE, len(goals)))
        for most, seeds in CANDIDATES:
            if not len(pending):
                break
            q, owner = world.configurations_at(goals[pending], most, seeds)
            owner = pending[owner]
            pending = np.unique(owner)
            q, owner = _in_turn(world, q, owner, starts, scenes)
            rows, first, counts = np.unique(owner, return_index=True, return_counts=True)
            found[rows], unreached = True, reached[rows] == 0
            filled[rows[unreached], 3:] = q[first[unreached]]
            place = np.arange(len(owner)) - np.repeat(first, counts)
            for begun, end in pairwise((0, *LOTS, most)):
                lot = (place >= begun) & (place < end)
                tried = np.flatnonzero(lot & np.isin(owner, pending))
                aims = owner[tried]
                wanted = np.concatenate([goals[aims, :3], q[tried]], axis=1)
                for passed, each in enumerate(ahead, start=1):
                    given = starts[aims], wanted, scenes_at(scenes, aims)
                    there = reached_by_control(each, *given)
                    aims, wanted = aims[there], wanted[there]
                    arrived, nearest = np.unique(aims, return_index=True)
                    better = reached[arrived] < passed
                    filled[arrived[better]] = wanted[nearest[better]]
                    reached[arrived[better]] = passed
                pending = pending[reached[pending] < len(ahead)]
    return found, filled


def _in_turn(
    world: World, q: Array, owner: NDArray[np.int64], starts: Array, scenes: Array
) -> tuple[Array, NDArray[np.int64]]:
    """Free configurations and their goals, those of a goal in the order in which they are tried."""
    free = world.free(q, scenes_at(scenes, owner))[1]
    q, owner = q[free], owner[free]
    touching, time = _straight_ways(world, starts[owner], q, scenes_at(scenes, owner))
    order = np.lexsort((time, touching, owner))
    return q[order], owner[order]


def reached_by_control(
    world: World, starts: Array, goals: Array, scenes: Array
) -> NDArray[np.bool_]:
    """Which goals control without a network is proven to reach, shape (n,).

    That is resolved-rate control, turned off bodies if they are seen. Where observations do not
    tell of its rates, it is straight motion. Takes starts, goals and scenes as `solved_by_ways`.
    """
    rates = world.layout.places.get("resolved_rate")
    if rates is None:
        return np.equal(_straight_ways(world, starts, goals[:, 3:], scenes)[0], 0)
    n, widths = len(starts), (world.n_observations, world.n_actions)
    control = Control(
        layers=np.array(widths),
        weights=np.zeros((1, (widths[0] + 1) * widths[1])),
        policy=np.zeros(n, dtype=np.int64),
        activations=np.array([LINEAR]),
        rates=rates.start,
    )
    episodes = world.episodes(starts, goals)
    if len(scenes):
        episodes.scenes[:] = scenes
    session = world.session(control, episodes)
    run_together(begin, n, world.threads, session.of_thread, np.arange(n))
    run_together(advance, n * world.rules.horizon, world.threads, session.of_thread)
    return np.equal(episodes.status, SUCCESS)


def _ahead(world: World, pace: int) -> World:
    """The world in which ways are tried: joints obey, steps may be longer, none is replaced."""
    task, stepping = world.problem.task, world.problem.stepping
    return world.changed(
        plant=Plant(),
        stepping=replace(stepping, time_step=pace * stepping.time_step, shield=False),
        task=replace(task, horizon=-(-task.horizon // pace)),
    )


def _straight_ways(
    world: World, starts: Array, ends: Array, scenes: Array
) -> tuple[NDArray[np.int64], Array]:
    """Of ``STRAIGHT`` points between configurations, how many touch; and how long they take.

    Configurations have the shape (n, n_joints) [rad or m]; times are in steps.
    """
    touching, limit = np.zeros(len(starts), dtype=np.int64), world.rules.step_limit
    for point in range(1, STRAIGHT + 1):
        q = starts + point / STRAIGHT * (ends - starts)
        touching += ~world.free(q, scenes)[1]
    return touching, (np.abs(ends - starts)[:, : len(limit)] / limit).max(axis=1)


class ScenarioQueues:
    """Starts and goals of the episodes of many arms, drawn together.

    An arm's are those of `draw_scenarios` with its generator, a few at a time. There is room for
    two draws: once an arm has no scenario left, all with room get more.
    """

    def __init__(self, world: World, n_arms: int) -> None:
        self._world, self._rngs = world, [np.random.default_rng() for _ in range(n_arms)]
        self._starts = np.empty((n_arms, 2 * PREFETCHED, world.arm.n_joints))
        self._goals = np.empty((n_arms, 2 * PREFETCHED, world.goal_width))
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
        drawn = draw_scenarios(self._world, rngs, PREFETCHED)
        self._starts[rows[:, None], places], self._goals[rows[:, None], places] = drawn
        self._drawn[rows] += PREFETCHED
