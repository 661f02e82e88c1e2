"""Maps of the benches from above, which tell where policies fail."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.html_report.groups import Group, TaskResults
from kinarm.evaluation.html_report.markup import DASH, Markup, join, number, tag
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
    def of(cls, benches: Sequence[Bench]) -> "View":
        """Show some benches, the arm's base and the axes with their names."""
        low, high = -BASE_RADIUS, AXIS_LENGTH + MARGIN
        bounds = [
            (min(low, *(side[0] for side in sides)), max(high, *(side[1] for side in sides)))
            for sides in ([bench.x for bench in benches], [bench.y for bench in benches])
        ]
        x, y = ((low - MARGIN, high + MARGIN) for low, high in bounds)
        return cls(x, y)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height in units of the SVG."""
        return (self.y[1] - self.y[0]) * SCALE, (self.x[1] - self.x[0]) * SCALE

    def place(
        self, x: float | NDArray[np.float64], y: float | NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Where points of the world lie in the SVG: to the right and down."""
        return np.asarray((self.y[1] - y) * SCALE), np.asarray((self.x[1] - x) * SCALE)


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


def bench_map(task: TaskResults, group: Group) -> Markup:
    """Draw the goals of a task where they lie, coloured by how close a group came to them.

    Parameters
    ----------
    task : TaskResults
        The task.
    group : Group
        One of its groups.
    """
    view = View.of(task.benches)
    width, height = view.size
    results = fates(group)
    reached = sum(fate.outcome == "success" for fate in results)
    return tag(
        "svg",
        [_bench(bench, view) for bench in task.benches],
        [_failures(bench, group, view) for bench in task.benches],
        _base(view),
        _markers(task, group, results, view),
        viewBox=f"0 0 {number(width)} {number(height)}",
        role="img",
        aria_label=f"{group.name} on {task.name}: of {len(results)} goals, {reached} were reached"
        + (" by every training seed" if len(group.members) > 1 else ""),
        class_="map",
    )


def _markers(task: TaskResults, group: Group, results: Sequence[Fate], view: View) -> list[Markup]:
    """Goals as markers, the worst on top."""
    goals = group.members[0].trials.goals[:MARKERS]
    across, down = view.place(goals[:, 0], goals[:, 1])
    order = np.argsort([fate.distance for fate in results[:MARKERS]], kind="stable")
    return [
        tag(
            "path",
            tag("title", _tooltip(int(trial), goals[trial], results[trial], len(group.members))),
            d=f"M{across[trial]:.1f},{down[trial]:.1f}{SYMBOLS[results[trial].outcome]}",
            class_=f"d{level(results[trial].distance, task.tolerance)}",
        )
        for trial in order
    ]


def _tooltip(trial: int, goal: NDArray[np.float64], fate: Fate, seeds: int) -> str:
    place = f"trial {trial}, goal ({goal[0]:.2f}, {goal[1]:.2f})"
    if seeds == 1:
        return f"{place}: {fate.distance:.3f} m, {OUTCOMES[fate.outcome]}"
    return f"{place}: {fate.reached} of {seeds} seeds reached it, mean {fate.distance:.3f} m"


OUTCOMES = {"success": "reached", "horizon": "out of steps", "collision": "contact"}
"""How outcomes are called on the page."""


def _bench(bench: Bench, view: View) -> Markup:
    """Footprint of a bench, to scale."""
    left, top = view.place(bench.x[1], bench.y[1])
    return tag(
        "rect",
        tag("title", f"bench {bench.name}"),
        x=float(left),
        y=float(top),
        width=(bench.y[1] - bench.y[0]) * SCALE,
        height=(bench.x[1] - bench.x[0]) * SCALE,
        class_="bench",
    )


def failure_shares(group: Group, bench: Bench) -> list[float | None]:
    """Share of trials that did not succeed, in slices of a bench along x, all seeds alike.

    Parameters
    ----------
    group : Group
        Whose trials.
    bench : Bench
        The bench.

    Returns
    -------
    list of float or None
        From the lower to the upper end of the bench; None where no goal lies.
    """
    goals = group.members[0].trials.goals
    failed = 1 - np.mean([member.rollouts.success for member in group.members], axis=0)
    across = (bench.y[0] <= goals[:, 1]) & (goals[:, 1] <= bench.y[1])
    slices = np.linspace(*bench.x, SLICES + 1)
    places = np.clip(np.searchsorted(slices, goals[:, 0], side="right") - 1, 0, SLICES - 1)
    inside = across & (bench.x[0] <= goals[:, 0]) & (goals[:, 0] <= bench.x[1])
    rows = [inside & (places == place) for place in range(SLICES)]
    return [float(failed[row].mean()) if row.any() else None for row in rows]


def _failures(bench: Bench, group: Group, view: View) -> Markup:
    """Bars from the edge of a bench towards the arm: how much fails along it."""
    inner, towards = (bench.y[0], 1) if sum(bench.y) > 0 else (bench.y[1], -1)
    slices = np.linspace(*bench.x, SLICES + 1)
    edge, _ = view.place(0.0, inner - towards * BAR_OFFSET)
    _, downs = view.place(slices, 0.0)
    full = towards * BAR_LENGTH * SCALE
    bars = [
        tag(
            "path",
            tag("title", f"x {low:.2f} to {high:.2f} m: {100 * share:.1f} % failed"),
            d=f"M{edge:.1f},{lower - 1:.1f}h{full * share:.1f}V{upper + 1:.1f}H{edge:.1f}z",
        )
        for (low, high), (lower, upper), share in zip(
            pairwise(slices), pairwise(downs), failure_shares(group, bench), strict=True
        )
        if share
    ]
    line = tag("path", d=f"M{edge + full:.1f},{downs[-1]:.1f}V{downs[0]:.1f}", class_="full")
    return tag("g", line, bars, class_="failures")


def _base(view: View) -> Markup:
    """The arm's base, and the world axes."""
    x, y = (float(place) for place in view.place(0.0, 0.0))
    length, name = AXIS_LENGTH * SCALE, "axis-name middle"
    return join(
        tag(
            "circle",
            tag("title", "base of the arm"),
            cx=x,
            cy=y,
            r=BASE_RADIUS * SCALE,
            class_="arm",
        ),
        tag("path", d=f"M{number(x)},{number(y)}v{-length:g}m-3,5l3,-5l3,5", class_="axis"),
        tag("path", d=f"M{number(x)},{number(y)}h{-length:g}m5,-3l-5,3l5,3", class_="axis"),
        tag("text", "x", x=x, y=y - length - 5, class_=name),
        tag("text", "y", x=x - length - 7, y=y + 4, class_=name),
    )


def map_legend(task: TaskResults) -> Markup:
    """What colours and shapes mean, once for all maps of a task."""
    bounds = [f"{task.tolerance * 2**step:g}" for step in range(LEVELS - 1)]
    ranges = [f"≤ {bounds[0]}"]
    ranges += [f"{low}{DASH}{high}" for low, high in pairwise(bounds)]
    ranges.append(f"> {bounds[-1]}")
    colours = [
        tag("li", _sample("success", f"d{step}"), tag("span", text))
        for step, text in enumerate(ranges)
    ]
    shapes = [
        tag("li", _sample(outcome, "plain"), tag("span", text))
        for outcome, text in OUTCOMES.items()
    ]
    pooled = any(len(group.members) > 1 for group in task.contenders)
    headings = (
        ("Mean final distance of the seeds [m]", "Worst outcome of the seeds")
        if pooled
        else ("Final distance [m]", "Outcome")
    )
    return join(
        tag("ul", tag("li", tag("b", heading)), samples, class_="legend")
        for heading, samples in zip(headings, (colours, shapes), strict=True)
    )


def _sample(outcome: str, style: str) -> Markup:
    marker = tag("path", d=f"M6,6{SYMBOLS[outcome]}", class_=style)
    return tag("svg", marker, viewBox="1 1 10 10", class_="map sample", aria_hidden="true")
