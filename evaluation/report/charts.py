"""Charts and maps of a problem: what they show and where; templates draw it.

Maps are of the goal regions from above, to scale, and tell where policies fail.
"""

from collections.abc import Iterable, Sequence
from itertools import islice, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm.evaluation.figures import BIN_WIDTH
from kinarm.evaluation.metrics import LIMITS
from kinarm.evaluation.report.groups import Group, ProblemResults
from kinarm.evaluation.statistics import share_over_seeds
from kinarm.scene import GoalRegion, Obstacle

WIDTH, LEFT, RIGHT, ABOVE, BELOW = 460, 46, 12, 14, 44
"""Width of a chart, and its margins, of which histograms have none above [units of the page]."""

PROFILE_HEIGHT, POINTS = 330, 121
"""Height of a profile, and the distances at which it is drawn beside those of the table."""

ROW_HEIGHT = 0.76
"""Of the tallest bar of a histogram, of the height of its row."""

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


class Chart(NamedTuple):
    """What a template draws of a problem, in units of the page.

    Ticks are places with their words, across and upwards; shapes are paths of each policy, with
    their classes and words.
    """

    height: float
    across: Sequence[tuple[float, str]]
    upwards: Sequence[tuple[float, str]]
    tolerance: float
    shapes: Sequence[tuple[Group, str, str, str]]


def profile_chart(results: ProblemResults) -> Chart:
    """Profiles of a problem with their 95 % bands, the oracle's as well; the best is on top."""
    limits = profile_limits(results)
    low, high = (float(end) for end in np.log10(limits[[0, -1]]))

    def x(distances: ArrayLike) -> NDArray[np.float64]:
        return LEFT + (np.log10(distances) - low) / (high - low) * (WIDTH - RIGHT - LEFT)

    def y(shares: ArrayLike) -> NDArray[np.float64]:
        return PROFILE_HEIGHT - BELOW - np.multiply(shares, PROFILE_HEIGHT - BELOW - ABOVE)

    shapes, there, back = [], x(limits), x(limits[::-1])
    for group in reversed(results.groups):
        shares = [share_over_seeds(group.distances <= limit) for limit in limits]
        rates, least, most = np.array([(share.value, *(share.ci95 or ())) for share in shares]).T
        band = f"{_path(there, y(most))}L{_path(back, y(least[::-1]))[1:]}z"
        shapes += [(group, "band", band, group.name)]
        shapes += [(group, "line", _path(there, y(rates)), group.name)]
    ticks = np.outer(10.0 ** np.arange(np.floor(low), high + 1), (1, 2, 5)).ravel()
    inside = ticks[(ticks > 0.999 * limits[0]) & (ticks < 1.001 * limits[-1])]
    across = [(float(x(tick)), f"{tick:g}") for tick in inside]
    upwards = [(float(y(share)), f"{100 * share:g} %") for share in (0, 0.25, 0.5, 0.75, 1)]
    return Chart(PROFILE_HEIGHT, across, upwards, float(x(results.tolerance)), shapes)


def profile_limits(results: ProblemResults) -> NDArray[np.float64]:
    """Distances at which the profiles of a problem are drawn [m], ascending."""
    furthest = max(float(group.distances.max()) for group in results.groups)
    low, high = results.tolerance / 5, max(furthest, 2 * results.tolerance)
    named = [limit for limit in (results.tolerance, *LIMITS) if low <= limit <= high]
    return np.unique(np.concatenate([np.geomspace(low, high, POINTS), named]))


def histogram_chart(results: ProblemResults) -> Chart:
    """Histograms of a problem below each other, all on the same scales.

    The height of a bar is the square root of its share, so that rare failures can be seen.
    """
    rows = len(results.groups)
    height = max(48, 270 // rows)  # rows share that of a profile, as long as it is enough
    furthest = max(float(group.distances.max()) for group in results.groups)
    edges = np.arange(0.0, furthest + 2 * BIN_WIDTH, BIN_WIDTH)
    unit = (WIDTH - LEFT - RIGHT) / edges[-1]
    spacing = 0.2 if edges[-1] < 2 else 0.5 * np.ceil(edges[-1] / 5)
    shapes, upwards = [], []
    for row, group in zip(range(rows, 0, -1), reversed(results.groups), strict=True):
        shares = np.histogram(group.distances, edges)[0] / group.distances.size
        upwards.append((row * height, f"{100 * shares[0]:.1f} %"))
        for low, share in zip(edges, shares, strict=False):
            if share:
                left, up = LEFT + unit * low, height * ROW_HEIGHT * np.sqrt(share)
                bar = f"M{left:.1f},{row * height}h{0.95 * BIN_WIDTH * unit:.1f}v{-up:.1f}"
                title = f"{low:.2f} to {low + BIN_WIDTH:.2f} m: {100 * share:.2f} % of trials"
                shapes.append((group, "bars", f"{bar}H{left:.1f}z", title))
    across = [(LEFT + unit * d, f"{d:g}") for d in np.arange(0, edges[-1], spacing).tolist()]
    tolerance = LEFT + unit * results.tolerance
    return Chart(rows * height + BELOW, across, upwards, tolerance, shapes)


def _path(xs: NDArray[np.float64], ys: NDArray[np.float64]) -> str:
    """A path through points; a tenth of a unit is what no eye can tell apart."""
    return "M" + "L".join(f"{x:.1f},{y:.1f}" for x, y in zip(xs, ys, strict=True))


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


class Marker(NamedTuple):
    """The goal of a trial: mean distance [m], outcome and how many training seeds reached it."""

    trial: int
    goal: list[float]
    distance: float
    outcome: str
    reached: int


def markers(group: Group) -> list[Marker]:
    """Goals of the first trials of a problem, the worst last, on top."""
    means, reached = group.distances.mean(axis=0).tolist(), group.success.sum(axis=0).tolist()
    goals = group.members[0].trials.goals.tolist()
    columns = (range(len(goals)), goals, means, worst_outcomes(group), reached)
    shown = islice(zip(*columns, strict=True), MARKERS)
    return sorted((Marker(*each) for each in shown), key=lambda marker: marker.distance)


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
