"""Maps of the goal regions from above, to scale, which tell where policies fail."""

from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from kinarm.evaluation.report.groups import Group, ProblemResults
from kinarm.scene import GoalRegion, Obstacle

SCALE = 200
"""Units of the SVG to a metre."""

MAP_MARGIN, BASE_RADIUS, AXIS_LENGTH = 0.07, 0.1, 0.2
"""Beside what a map has to show, of the circle for the arm's base, and of the world axes [m]."""

MARKERS = 1000
"""Trials of which a map shows markers, the first ones; the figures beside them count all."""

SLICES = 10
"""Of a region, along x, whose failures are counted."""

BAR_OFFSET, BAR_LENGTH = 0.02, 0.25
"""Where the bars of failures begin beside the region, and the length of 100 % [m]."""

DISTANCE_COLOURS = 6
"""Colours of distances: within the tolerance, and twice the distance from one to the next."""

OUTCOME_WORDS = {"success": "reached", "truncated": "out of steps", "collision": "contact"}
"""How outcomes are called on the page."""

SYMBOLS = {
    "success": "m-3,0a3,3 0 1,0 6,0a3,3 0 1,0 -6,0z",
    "truncated": "m-2.8,-2.8h5.6v5.6h-5.6z",
    "collision": "m0,-4.2l1.3,2.9l2.9,1.3l-2.9,1.3l-1.3,2.9l-1.3,-2.9l-2.9,-1.3l2.9,-1.3z",
}
"""Paths of the markers about their centre, by outcome."""


class View(NamedTuple):
    """Bounds of a map of the world, seen from above [m]: x points up and y to the left."""

    x: tuple[float, float]
    y: tuple[float, float]

    @classmethod
    def of(cls, regions: Iterable[GoalRegion]) -> "View":
        """Show some regions, the arm's base and the axes with their names."""
        corners = [(-BASE_RADIUS,) * 2, (AXIS_LENGTH + MAP_MARGIN,) * 2]
        corners += [corner[:2] for region in regions for corner in (region.lower, region.upper)]
        low, high = np.min(corners, axis=0) - MAP_MARGIN, np.max(corners, axis=0) + MAP_MARGIN
        return cls((float(low[0]), float(high[0])), (float(low[1]), float(high[1])))

    def shows(self, box: Obstacle | GoalRegion) -> bool:
        """Whether some of a box is in view."""
        return all(box.lower[k] < high and low < box.upper[k] for k, (low, high) in enumerate(self))

    def across(self, y: float) -> float:
        """Where a y [m] lies in the SVG, from the left."""
        return (self.y[1] - y) * SCALE

    def down(self, x: float) -> float:
        """Where an x [m] lies in the SVG, from the top."""
        return (self.x[1] - x) * SCALE

    def failure_bars(self, region: GoalRegion) -> tuple[float, float]:
        """Where bars beside a region begin, and how far 100 % reaches, towards the arm."""
        right, left = region.lower[1], region.upper[1]
        inner, inward = (right, 1) if right + left > 0 else (left, -1)
        return self.across(inner - inward * BAR_OFFSET), inward * BAR_LENGTH * SCALE


def worst_outcomes(group: Group) -> list[str]:
    """Outcome of each trial: contact if any training seed had it, success if all had."""
    collision = np.any([member.rollouts.collision for member in group.members], axis=0)
    success = np.where(group.success.all(axis=0), "success", "truncated")
    outcomes: list[str] = np.where(collision, "collision", success).tolist()
    return outcomes


def level(distance: float, tolerance: float) -> int:
    """Which of the `DISTANCE_COLOURS` colours a distance [m] gets."""
    if distance <= tolerance:
        return 0
    return min(int(np.ceil(np.log2(distance / tolerance) - 1e-12)), DISTANCE_COLOURS - 1)


def markers(results: ProblemResults, group: Group) -> Iterator[tuple[str, int, str]]:
    """Path, level of colour and words of the goals of a problem, the worst last, on top."""
    view, outcomes = View.of(results.goal_regions), worst_outcomes(group)
    means, reached = group.distances.mean(axis=0), group.success.sum(axis=0)
    goals = group.members[0].trials.goals
    for trial in np.argsort(means[:MARKERS], kind="stable").tolist():
        (x, y, _), distance = goals[trial], means[trial]
        path = f"M{view.across(y):.1f},{view.down(x):.1f}{SYMBOLS[outcomes[trial]]}"
        ending = f"{distance:.3f} m, {OUTCOME_WORDS[outcomes[trial]]}"
        if len(group.members) > 1:
            seeds = f"{reached[trial]} of {len(group.members)} seeds reached it"
            ending = f"{seeds}, mean {distance:.3f} m"
        title = f"trial {trial}, goal ({x:.2f}, {y:.2f}): {ending}"
        yield path, level(distance, results.tolerance), title


def failure_shares(
    group: Group, region: GoalRegion
) -> list[tuple[tuple[float, float], float | None]]:
    """Share of trials that did not succeed, in slices of a region along x, all seeds alike.

    Each with the ends of its slice [m], ascending; None where no goal lies.
    """
    goals, failed = group.members[0].trials.goals, 1 - group.success.mean(axis=0)
    inside = ((region.lower <= goals) & (goals <= region.upper)).all(axis=1)
    slices = np.linspace(region.lower[0], region.upper[0], SLICES + 1)
    places = np.clip(np.searchsorted(slices, goals[:, 0], side="right") - 1, 0, SLICES - 1)
    rows = [inside & (places == place) for place in range(SLICES)]
    shares = [float(failed[row].mean()) if row.any() else None for row in rows]
    return list(zip(pairwise(slices.tolist()), shares, strict=True))


def level_ranges(results: ProblemResults) -> list[str]:
    """Ranges of distances [m] that the colours stand for."""
    bounds = [f"{results.tolerance * 2**step:g}" for step in range(DISTANCE_COLOURS - 1)]
    between = [f"{low}\N{EN DASH}{high}" for low, high in pairwise(bounds)]
    return [f"≤ {bounds[0]}", *between, f"> {bounds[-1]}"]
