"""The figure of a study of transfer, from its document."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from kinarm.evaluation.figures import COLOURS, DASHES, panels_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PLACES = 200
"""Points of a curve."""

ROLES = {"warm": "warm start", "scratch": "from scratch"}
"""What is drawn, each in a colour of its own."""


def learning_curves(document: Mapping[str, Any]) -> "Figure":
    """Success against environment steps, a row per learner and a column per problem.

    Lines are means over the training seeds, bands reach from the worst of them to the best.
    Dotted is what the policies of the first task do as they are.
    """
    from matplotlib.ticker import NullFormatter

    learners: list[str] = document["learners"]
    problems = list(dict.fromkeys(row["problem"] for row in document["warm_start"]))
    size = (1.0 + 3.2 * len(problems), 1.0 + 2.8 * len(learners))
    shape = len(learners), len(problems)
    figure, panels = panels_figure(size, *shape, sharex="row", sharey=True)
    for learner, row in zip(learners, panels, strict=True):
        for problem, axes in zip(problems, row, strict=True):
            _draw_panel(axes, document, learner, problem)
            axes.set(xscale="log", ylim=(0, 1.02), title=f"{learner.upper()}, {problem}")
            axes.xaxis.set_minor_formatter(NullFormatter())
        row[0].set_ylabel("share of trials with success")
    for axes in panels[-1]:
        axes.set_xlabel("environment steps")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, frameon=False, fontsize=8)
    return figure


def _draw_panel(axes: "Axes", document: Mapping[str, Any], learner: str, problem: str) -> None:
    """Draw all curves of a learner on a problem, and what a policy of the first task does."""
    for number, (role, title) in enumerate(ROLES.items()):
        for length, dash in zip(document["lengths"], DASHES, strict=False):
            wanted = {"learner": learner, "problem": problem, "role": role, "length": length}
            curves = _chosen(document["curves"], wanted)
            _draw_curve(axes, curves, COLOURS[number], dash, f"{title}, length {length:g}")
    (nothing,) = _chosen(
        document["zero_shot"], {"learner": learner, "problem": problem, "way": "as it is"}
    )
    axes.axhline(nothing["success"]["value"], color="#444444", linestyle=":", label="as it is")


def _chosen(rows: Sequence[Any], wanted: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Rows with some entries."""
    return [row for row in rows if all(row[name] == entry for name, entry in wanted.items())]


def _draw_curve(
    axes: "Axes", curves: Sequence[Mapping[str, Any]], colour: str, dash: str, label: str
) -> None:
    """Draw the mean over the training seeds, and the band between the worst and the best."""
    steps = [curve["environment_steps"] for curve in curves]
    first = max(each[1] for each in steps)  # before it, no step was taken
    places = np.geomspace(first, max(first, min(each[-1] for each in steps)), PLACES)
    success = np.array(
        [
            np.interp(places, each, curve["success"])
            for each, curve in zip(steps, curves, strict=True)
        ]
    )
    low, high = success.min(axis=0), success.max(axis=0)
    axes.fill_between(places, low, high, color=colour, alpha=0.15, lw=0)
    axes.plot(places, success.mean(axis=0), color=colour, linestyle=dash, lw=2, label=label)
