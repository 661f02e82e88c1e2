"""What charts and maps of a problem show; templates draw it."""

from collections.abc import Iterable
from itertools import islice, pairwise
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull

from kinarm.evaluation.figures import BIN_WIDTH
from kinarm.evaluation.metrics import LIMITS
from kinarm.evaluation.report.groups import Group, ProblemResults
from kinarm.evaluation.statistics import Estimate, share_over_seeds
from kinarm.meshes import coal_shape
from kinarm.scene import GoalRegion, Scene
from kinarm.viewer.meshes import from_coal

POINTS = 121
"""Distances of a profile, beside those of the table."""

SCALE = 200
"""Units of the SVG to a metre."""

MAP_MARGIN, BASE_RADIUS, AXIS_LENGTH = 0.07, 0.1, 0.2
"""Margin of a map, radius of the arm's base, length of the axes [m]."""

MARKERS = 1000
"""Most trials that a map marks, the first ones; its figures count all."""

SLICES = 10
"""Slices of a region, along x, whose failures are counted."""

DISTANCE_COLOURS = 6
"""Colours of distances: within the tolerance, then each for twice the distance."""


def profiles(results: ProblemResults) -> tuple[list[float], list[list[Estimate]]]:
    """Ascending distances [m], and each group's share of trials within each."""
    furthest = max(float(group.distances.max()) for group in results.groups)
    low, high = results.tolerance / 5, max(furthest, 2 * results.tolerance)
    named = [limit for limit in (results.tolerance, *LIMITS) if low <= limit <= high]
    limits = np.unique(np.concatenate([np.geomspace(low, high, POINTS), named])).tolist()
    return limits, [
        [share_over_seeds(group.distances <= limit) for limit in limits] for group in results.groups
    ]


def histograms(results: ProblemResults) -> tuple[list[float], list[list[float]]]:
    """Edges of the bins of final distances [m], and each group's shares of trials."""
    furthest = max(float(group.distances.max()) for group in results.groups)
    edges = np.arange(0.0, furthest + 2 * BIN_WIDTH, BIN_WIDTH)
    counts = [np.histogram(group.distances, edges)[0] for group in results.groups]
    sizes = [group.distances.size for group in results.groups]
    return edges.tolist(), [(n / size).tolist() for n, size in zip(counts, sizes, strict=True)]


class View(NamedTuple):
    """Bounds of a map seen from above [m]: x points up and y to the left."""

    x: tuple[float, float]
    y: tuple[float, float]

    @classmethod
    def of(cls, regions: Iterable[GoalRegion]) -> "View":
        """Show some regions, the arm's base and the axes with their names."""
        corners = [(-BASE_RADIUS,) * 2, (AXIS_LENGTH + MAP_MARGIN,) * 2]
        corners += [corner[:2] for region in regions for corner in (region.lower, region.upper)]
        low, high = np.min(corners, axis=0) - MAP_MARGIN, np.max(corners, axis=0) + MAP_MARGIN
        return cls((float(low[0]), float(high[0])), (float(low[1]), float(high[1])))


def footprints(scene: Scene, view: View) -> list[tuple[str, list[list[float]]]]:
    """Names of the obstacles in view, and their outlines from above [m]; half-spaces have none."""
    (low, high), found = np.array(view).T, []
    for body in scene.bodies[: len(scene.obstacles)]:
        if body.shape != "halfspace":
            placed = from_coal(coal_shape(body)).moved(body.position, body.rotation)
            points = placed.vertices[:, :2]
            if (points.min(axis=0) < high).all() and (low < points.max(axis=0)).all():
                found.append((body.name, points[ConvexHull(points).vertices].tolist()))
    return found


def worst_outcomes(group: Group) -> list[str]:
    """Outcome of each trial: contact if any seed had it, success if all had."""
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
    """A goal: mean distance [m], outcome, and how many seeds reached it."""

    trial: int
    goal: list[float]
    distance: float
    outcome: str
    reached: int


def markers(group: Group) -> list[Marker]:
    """Goals of the first trials of a problem, the worst last, on top."""
    means, reached = group.distances.mean(axis=0).tolist(), group.success.sum(axis=0).tolist()
    goals = group.members[0].trials.goals[:, :3].tolist()
    columns = (range(len(goals)), goals, means, worst_outcomes(group), reached)
    shown = islice(zip(*columns, strict=True), MARKERS)
    return sorted((Marker(*each) for each in shown), key=lambda marker: marker.distance)


def failure_shares(
    group: Group, region: GoalRegion
) -> list[tuple[tuple[float, float], float | None]]:
    """Share of trials that failed, over all seeds, in slices of a region along x.

    Each with the ends of its slice [m], ascending; None where no goal lies.
    """
    goals, failed = group.members[0].trials.goals, 1 - group.success.mean(axis=0)
    inside = ((region.lower <= goals[:, :3]) & (goals[:, :3] <= region.upper)).all(axis=1)
    slices = np.linspace(region.lower[0], region.upper[0], SLICES + 1)
    places = np.clip(np.searchsorted(slices, goals[:, 0], side="right") - 1, 0, SLICES - 1)
    rows = [inside & (places == place) for place in range(SLICES)]
    shares = [float(failed[row].mean()) if row.any() else None for row in rows]
    return list(zip(pairwise(slices.tolist()), shares, strict=True))
