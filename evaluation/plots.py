"""Figures of an evaluation."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kinarm.evaluation.evaluate import Evaluation
from kinarm.files import write_atomically

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#999999", "#000000")
"""Distinguishable with any colour vision (Okabe and Ito)."""

BIN_WIDTH = 0.05


def distance_histograms(evaluations: Sequence[Evaluation]) -> "Figure":
    """Histograms of the final distance, a panel per task (paper, Figure 2, right).

    Training seeds of one recipe share a colour: the line is their mean, thin lines are the seeds.

    Parameters
    ----------
    evaluations : sequence of Evaluation
        Any policies on any tasks.
    """
    from matplotlib.figure import Figure

    tasks = list(dict.fromkeys(evaluation.task for evaluation in evaluations))
    groups = list(dict.fromkeys(evaluation.entrant.group for evaluation in evaluations))
    colours = _group_colours(groups)
    furthest = max(float(evaluation.rollouts.distance.max()) for evaluation in evaluations)
    edges = np.arange(0.0, furthest + BIN_WIDTH, BIN_WIDTH)
    figure = Figure(figsize=(4.2 * len(tasks), 3.6), layout="constrained")
    for axes, task in zip(figure.subplots(1, len(tasks), squeeze=False)[0], tasks, strict=True):
        for group in groups:
            members = [e for e in evaluations if (e.entrant.group, e.task) == (group, task)]
            if not members:
                continue
            shares = np.array(
                [np.histogram(e.rollouts.distance, edges)[0] / len(e.trials) for e in members]
            )
            label, colour = _label(members[0]), colours[group]
            for share in shares if len(shares) > 1 else ():
                axes.stairs(share, edges, color=colour, alpha=0.3, linewidth=0.8)
            axes.stairs(shares.mean(axis=0), edges, color=colour, linewidth=2, label=label)
        axes.axvline(
            members_tolerance(evaluations, task), color="#444444", linestyle=":", linewidth=1
        )
        axes.set(title=f"task {task}", xlabel="final distance to the goal [m]", xlim=(0, None))
        axes.set_ylim(0, None)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(frameon=False, fontsize=8)
    figure.axes[0].set_ylabel(f"share of trials per {BIN_WIDTH} m")
    return figure


def members_tolerance(evaluations: Sequence[Evaluation], task: str) -> float:
    """Distance at which a task counts as done [m]."""
    return next(e.trials.simulator.task.tolerance for e in evaluations if e.task == task)


def _label(evaluation: Evaluation) -> str:
    entrant = evaluation.entrant
    return entrant.name if entrant.policy is None else f"{entrant.algorithm} {entrant.recipe}"


def _group_colours(groups: Sequence[str]) -> dict[str, str]:
    """One colour per recipe, the same in every task."""
    kinds = list(dict.fromkeys(_kind(group) for group in groups))
    return {group: COLOURS[kinds.index(_kind(group)) % len(COLOURS)] for group in groups}


def _kind(group: str) -> str:
    return group.rsplit("-", 1)[0]


def save_figure(figure: "Figure", folder: Path, name: str) -> tuple[Path, ...]:
    """Write a figure as PNG and as SVG; equal figures give equal files."""
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
