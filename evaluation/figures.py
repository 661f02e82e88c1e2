"""Figures of an evaluation."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kinarm._files import write_atomically
from kinarm.evaluation.evaluation import Evaluation
from kinarm.evaluation.training_seeds import group_names

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#999999", "#000000")
"""Distinguishable with any colour vision (Okabe and Ito)."""

DASHES = ("solid", "dashed", "dotted", "dashdot")

BIN_WIDTH = 0.05


def distance_histograms(evaluations: Sequence[Evaluation]) -> "Figure":
    """Histograms of the final distance, a panel per problem (paper, Figure 2, right).

    Training seeds of one recipe share a colour: the line is their mean, thin lines are the seeds.

    Parameters
    ----------
    evaluations : sequence of Evaluation
        Any policies on any problems.
    """
    from matplotlib.figure import Figure

    problems = {evaluation.problem.digest: evaluation.problem for evaluation in evaluations}
    labels = series_labels(evaluations)
    furthest = max(float(evaluation.rollouts.distance.max()) for evaluation in evaluations)
    edges = np.arange(0.0, furthest + BIN_WIDTH, BIN_WIDTH)
    figure = Figure(figsize=(4.2 * len(problems), 3.6), layout="constrained")
    panels = figure.subplots(1, len(problems), squeeze=False)[0]
    for axes, (digest, problem) in zip(panels, problems.items(), strict=True):
        facing = [
            (label, evaluation.rollouts.distance)
            for label, evaluation in zip(labels, evaluations, strict=True)
            if evaluation.problem.digest == digest
        ]
        for number, label in enumerate(dict.fromkeys(labels)):
            distances = [each for shown, each in facing if shown == label]
            if distances:
                _stairs(axes, distances, edges, label, number)
        axes.axvline(problem.task.tolerance, color="#444444", linestyle=":", linewidth=1)
        axes.set(title=problem.name, xlabel="final distance to the goal [m]", xlim=(0, None))
        axes.set_ylim(0, None)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(frameon=False, fontsize=8)
    figure.axes[0].set_ylabel(f"share of trials per {BIN_WIDTH} m")
    return figure


def _stairs(
    axes: "Axes",
    distances: Sequence[NDArray[np.float64]],
    edges: NDArray[np.float64],
    label: str,
    number: int,
) -> None:
    """Draw the histogram of each training seed faintly and their mean boldly."""
    colour, dash = COLOURS[number % len(COLOURS)], DASHES[number // len(COLOURS) % len(DASHES)]
    shares = np.array([np.histogram(d, edges)[0] / len(d) for d in distances])
    for share in shares if len(shares) > 1 else ():
        axes.stairs(share, edges, color=colour, alpha=0.3, linewidth=0.8)
    axes.stairs(shares.mean(axis=0), edges, color=colour, linestyle=dash, linewidth=2, label=label)


def draw_band(
    axes: "Axes",
    places: NDArray[np.float64],
    heights: NDArray[np.float64],
    label: str,
    colour: str,
    dash: str,
) -> None:
    """Draw the mean of curves, and a band from the lowest to the highest.

    Parameters
    ----------
    axes : Axes
        Where to.
    places, heights : ndarray, shape (n_places,) and (n_curves, n_places)
        The curves.
    label, colour, dash : str
        Name and look of the mean.
    """
    low, high = heights.min(axis=0), heights.max(axis=0)
    axes.fill_between(places, low, high, color=colour, alpha=0.15, lw=0)
    axes.plot(places, heights.mean(axis=0), color=colour, linestyle=dash, lw=2, label=label)


def series_labels(evaluations: Sequence[Evaluation]) -> list[str]:
    """Name of what the training seeds of a recipe share, and its problem if it is another one.

    A symmetric policy for several goal regions has one name on all problems that it is for.
    """
    groups = group_names(evaluation.contestant for evaluation in evaluations)
    return [_label(evaluation, groups[evaluation.contestant.name]) for evaluation in evaluations]


def _label(evaluation: Evaluation, group: str) -> str:
    policy, faced = evaluation.contestant.policy, evaluation.problem
    if policy is None:
        return evaluation.contestant.name
    trained_for = policy.problem
    own, others = (set(problem.task.goal_regions) for problem in (trained_for, faced))
    symmetric = policy.mirror is not None and len(own) > 1
    if symmetric and own >= others and trained_for.same_place(faced):
        return group
    origin = "" if trained_for.name == faced.name else f" (trained on {trained_for.name})"
    return group.removesuffix(f"-{trained_for.name}") + origin


def save_figure(figure: "Figure", folder: Path, name: str) -> tuple[Path, ...]:
    """Write a figure as PNG and as SVG; equal figures give equal files.

    Parameters
    ----------
    figure : Figure
        The figure.
    folder : Path
        Where to.
    name : str
        Name of the files, without the suffix.
    """
    import matplotlib

    paths = (folder / f"{name}.png", folder / f"{name}.svg")
    metadata = ({"Software": None}, {"Date": None, "Creator": None})
    with matplotlib.rc_context({"svg.hashsalt": "kinarm"}):
        for path, entries in zip(paths, metadata, strict=True):
            write_atomically(
                path,
                partial(figure.savefig, format=path.suffix[1:], dpi=150, metadata=entries),
            )
    return paths
