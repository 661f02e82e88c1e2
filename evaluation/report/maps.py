"""Maps of the benches from above, which tell where policies fail.

They are a template of the page: every marker carries its own words, colour and shape, and they
are to scale, which leaves nothing for a plotting library to work out.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.report.groups import Group, TaskResults
from kinarm.scene import Bench

SCALE = 200
"""Units of the SVG to a metre."""

MARGIN = 0.07
"""Beside the outermost bench and the arm's base [m]."""

BASE_RADIUS = 0.1
"""Of the circle that stands for the arm [m]."""

MARKERS = 1000
"""Trials of which a map shows markers, the first ones; the figures beside them count all."""

SLICES = 10
"""Of a bench, along x, whose failures are counted."""

BAR_OFFSET, BAR_LENGTH = 0.02, 0.25
"""Where the bars of failures begin beside the bench, and the length of 100 % [m]."""

AXIS_LENGTH = 0.2
"""Of the world axes [m]."""

LEVELS = 6
"""Colours of distances: within the tolerance, and twice the distance from one to the next."""

OUTCOMES = {"success": "reached", "horizon": "out of steps", "collision": "contact"}
"""How outcomes are called on the page."""

SYMBOLS = {
    "success": "m-3,0a3,3 0 1,0 6,0a3,3 0 1,0 -6,0z",
    "horizon": "m-2.8,-2.8h5.6v5.6h-5.6z",
    "collision": "m0,-4.2l1.3,2.9l2.9,1.3l-2.9,1.3l-1.3,2.9l-1.3,-2.9l-2.9,-1.3l2.9,-1.3z",
}
"""Paths of the markers about their centre, by outcome."""


class View(NamedTuple):
    """What a map shows of the world, seen from above: x points up and y to the left.

    Attributes
    ----------
    x, y : tuple of float
        Lower and upper bound [m].
    """

    x: tuple[float, float]
    y: tuple[float, float]

    @classmethod
    def of(cls, benches: tuple[Bench, ...]) -> "View":
        """Show some benches, the arm's base and the axes with their names."""
        low, high = -BASE_RADIUS, AXIS_LENGTH + MARGIN
        bounds = [
            (min(low, *(side[0] for side in sides)), max(high, *(side[1] for side in sides)))
            for sides in ([bench.x for bench in benches], [bench.y for bench in benches])
        ]
        x, y = ((low - MARGIN, high + MARGIN) for low, high in bounds)
        return cls(x, y)

    def across(self, y: float) -> float:
        """Where a y [m] lies in the SVG, from the left."""
        return (self.y[1] - y) * SCALE

    def down(self, x: float) -> float:
        """Where an x [m] lies in the SVG, from the top."""
        return (self.x[1] - x) * SCALE

    def failure_bars(self, bench: Bench) -> tuple[float, float]:
        """Where bars beside a bench begin, and how far 100 % reaches, towards the arm."""
        inner, inward = (bench.y[0], 1) if sum(bench.y) > 0 else (bench.y[1], -1)
        return self.across(inner - inward * BAR_OFFSET), inward * BAR_LENGTH * SCALE


class Fate(NamedTuple):
    """What became of one trial in the hands of one or several training seeds.

    Attributes
    ----------
    reached : int
        How many seeds reached the goal.
    distance : float
        Mean of the final distances [m].
    outcome : str
        ``"collision"`` if any seed touched something, else ``"horizon"`` if any ran out of
        steps, else ``"success"``.
    """

    reached: int
    distance: float
    outcome: str


def fates(group: Group) -> tuple[Fate, ...]:
    """What became of each trial in the hands of a group."""
    success = np.array([member.rollouts.success for member in group.members])
    collision = np.array([member.rollouts.collision for member in group.members])
    outcomes = np.where(
        collision.any(axis=0), "collision", np.where(success.all(axis=0), "success", "horizon")
    )
    columns = (success.sum(axis=0), group.distances.mean(axis=0), outcomes)
    return tuple(
        Fate(int(reached), float(distance), str(outcome))
        for reached, distance, outcome in zip(*columns, strict=True)
    )


def level(distance: float, tolerance: float) -> int:
    """Which of the `LEVELS` colours a distance [m] gets."""
    if distance <= tolerance:
        return 0
    return min(int(np.ceil(np.log2(distance / tolerance) - 1e-12)), LEVELS - 1)


class Marker(NamedTuple):
    """A goal on a map.

    Attributes
    ----------
    path : str
        Where it lies, and its shape.
    level : int
        Its colour.
    title : str
        What is said where the pointer is.
    """

    path: str
    level: int
    title: str


def markers(task: TaskResults, group: Group) -> list[Marker]:
    """Goals of a task by how a group did, the worst last, on top."""
    view, results = View.of(task.benches), fates(group)[:MARKERS]
    goals = group.members[0].trials.goals
    order = np.argsort([fate.distance for fate in results], kind="stable").tolist()
    return [
        Marker(
            f"M{view.across(goals[trial, 1]):.1f},{view.down(goals[trial, 0]):.1f}"
            + SYMBOLS[results[trial].outcome],
            level(results[trial].distance, task.tolerance),
            _marker_title(trial, goals[trial], results[trial], len(group.members)),
        )
        for trial in order
    ]


def _marker_title(trial: int, goal: NDArray[np.float64], fate: Fate, seeds: int) -> str:
    place = f"trial {trial}, goal ({goal[0]:.2f}, {goal[1]:.2f})"
    if seeds == 1:
        return f"{place}: {fate.distance:.3f} m, {OUTCOMES[fate.outcome]}"
    return f"{place}: {fate.reached} of {seeds} seeds reached it, mean {fate.distance:.3f} m"


def failure_shares(group: Group, bench: Bench) -> list[tuple[tuple[float, float], float | None]]:
    """Share of trials that did not succeed, in slices of a bench along x, all seeds alike.

    Parameters
    ----------
    group : Group
        Whose trials.
    bench : Bench
        The bench.

    Returns
    -------
    list of tuple
        Ends of each slice [m], ascending, and its share; None where no goal lies.
    """
    goals = group.members[0].trials.goals
    failed = 1 - np.mean([member.rollouts.success for member in group.members], axis=0)
    across = (bench.y[0] <= goals[:, 1]) & (goals[:, 1] <= bench.y[1])
    slices = np.linspace(*bench.x, SLICES + 1)
    places = np.clip(np.searchsorted(slices, goals[:, 0], side="right") - 1, 0, SLICES - 1)
    inside = across & (bench.x[0] <= goals[:, 0]) & (goals[:, 0] <= bench.x[1])
    rows = [inside & (places == place) for place in range(SLICES)]
    shares = [float(failed[row].mean()) if row.any() else None for row in rows]
    return list(zip(pairwise(slices.tolist()), shares, strict=True))


def description(task: TaskResults, group: Group) -> str:
    """What a map shows, for those who cannot see it."""
    outcomes = [fate.outcome for fate in fates(group)]
    every = " by every training seed" if len(group.members) > 1 else ""
    return (
        f"{group.name} on {task.name}: of {len(outcomes)} goals, {outcomes.count('success')} were "
        f"reached{every}"
    )


def level_ranges(task: TaskResults) -> list[str]:
    """Ranges of distances [m] that the colours stand for."""
    bounds = [f"{task.tolerance * 2**step:g}" for step in range(LEVELS - 1)]
    between = [f"{low}\N{EN DASH}{high}" for low, high in pairwise(bounds)]
    return [f"≤ {bounds[0]}", *between, f"> {bounds[-1]}"]
