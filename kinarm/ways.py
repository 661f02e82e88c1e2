"""Which configuration at a goal the arm is to take: one that control without a network reaches."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from kinarm._parallel import run_together
from kinarm.episode_draws import scenes_at
from kinarm.episodes import LINEAR, SUCCESS, Control
from kinarm.kernels.compiling import Array
from kinarm.kernels.rollout import advance, begin
from kinarm.plant import Plant
from kinarm.world import World

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
