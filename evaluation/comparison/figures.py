"""Learning curves of a comparison, and where they end."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kinarm.evaluation.comparison.results import Comparison, Series
from kinarm.evaluation.figures import COLOURS, DASHES, draw_band

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Across(NamedTuple):
    """What curves are drawn against: name on the axis, one of its unit, where it begins."""

    label: str
    unit: float
    begin: float


ACROSS = {
    "environment_steps": Across("environment steps", 1.0, 5e3),
    "processor_seconds": Across("processor time [min]", 60.0, 0.01),
}

PLACES = 200
"""Points of a curve."""


def learning_curves(comparison: Comparison) -> "Figure":
    """Success in the course of the training, a row per problem.

    On the left against environment steps, on the right against processor time; both axes are
    logarithmic. Lines are means over the training seeds, bands reach from the worst of them to
    the best. The dotted line is the share of trials in which any policy could succeed.
    """
    from matplotlib.figure import Figure

    problems = list(comparison.reachable)
    names = list(dict.fromkeys(series.learner.name for series in comparison.series))
    figure = Figure(figsize=(10.0, 1.0 + 3.2 * len(problems)), layout="constrained")
    panels = figure.subplots(len(problems), 2, squeeze=False, sharex="col", sharey=True)
    for problem, row in zip(problems, panels, strict=True):
        for (quantity, across), axes in zip(ACROSS.items(), row, strict=True):
            for series in comparison.series:
                if series.problem.name == problem:
                    _draw(axes, series, quantity, names.index(series.learner.name))
            axes.axhline(comparison.reachable[problem], color="#444444", linestyle=":", lw=1)
            axes.set(xscale="log", ylim=(0, 1.02), title=problem)
            axes.set_xlim(left=across.begin)
            axes.spines[["top", "right"]].set_visible(False)
        row[0].set_ylabel("share of trials with success")
    for across, axes in zip(ACROSS.values(), panels[-1], strict=True):
        axes.set_xlabel(across.label)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    return figure


def _draw(axes: "Axes", series: Series, quantity: str, number: int) -> None:
    """Draw the mean over the training seeds, and the band between the worst and the best."""
    ends = [(getattr(c[0], quantity), getattr(c[-1], quantity)) for c in series.curves]
    first, last = max(min(first for first, _ in ends), 1e-3), min(last for _, last in ends)
    places = np.geomspace(first, max(first, last), PLACES)
    success = np.nan_to_num(series.success_at(quantity, places))
    colour, dash = COLOURS[number % len(COLOURS)], DASHES[number // len(COLOURS) % len(DASHES)]
    draw_band(axes, places / ACROSS[quantity].unit, success, series.learner.title, colour, dash)


def final_success(comparison: Comparison) -> "Figure":
    """Success of the trained policies, a row per learner and a panel per problem; the best on top.

    Dots are training seeds, lines the 95 % intervals of their means over trials. The dotted line is
    the share of trials in which any policy could succeed.
    """
    from matplotlib.figure import Figure

    grouped = {
        problem: sorted(
            (series for series in comparison.series if series.problem.name == problem),
            key=lambda series: series.success.value or 0.0,
        )
        for problem in comparison.reachable
    }
    heights = [0.5 + 0.24 * len(ranked) for ranked in grouped.values()]
    figure = Figure(figsize=(7.2, 0.4 + sum(heights)), layout="constrained")
    panels = figure.subplots(len(grouped), squeeze=False, sharex=True, height_ratios=heights)
    for (problem, ranked), axes in zip(grouped.items(), panels[:, 0], strict=True):
        for height, series in enumerate(ranked):
            ends = series.success.ci95 or (np.nan, np.nan)
            axes.plot([100 * end for end in ends], [height, height], color=COLOURS[0])
            each = [100 * curve[-1].successes / series.trials for curve in series.curves]
            axes.plot(each, [height] * len(each), "o", color=COLOURS[1], markersize=4)
        axes.axvline(100 * comparison.reachable[problem], color="#444444", linestyle=":", lw=1)
        axes.set_yticks(range(len(ranked)), [series.learner.title for series in ranked])
        axes.set(title=problem, xlim=(-1, 101))
        axes.grid(axis="x", alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
    panels[-1, 0].set_xlabel("trials with success [%]")
    return figure
