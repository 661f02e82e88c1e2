"""Chart of the histograms of the final distance, a row per group."""

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.html_report.axes import Axis, bottom_axis, tolerance_line
from kinarm.evaluation.html_report.groups import Group, TaskResults
from kinarm.evaluation.html_report.markup import Markup, tag
from kinarm.evaluation.plots import BIN_WIDTH

WIDTH, LEFT, RIGHT, TOP = 460, 46, 448, 4
GAP = 14
"""Space above the tallest bar of a row."""


def row_height(rows: int) -> int:
    """Height of a row without its gap: rows share what a profile takes, while there is enough."""
    return max(34, 270 // rows - GAP)


def histogram_chart(task: TaskResults) -> Markup:
    """Draw the histograms of a task below each other, all on the same scales.

    The height of a bar is the square root of its share, so that rare failures can be seen.

    Parameters
    ----------
    task : TaskResults
        The task.
    """
    furthest = max(float(group.distances.max()) for group in task.groups)
    edges = np.arange(0.0, furthest + 2 * BIN_WIDTH, BIN_WIDTH)
    across = Axis(0, float(edges[-1]), LEFT, RIGHT)
    height = row_height(len(task.groups)) + GAP
    bottom = TOP + len(task.groups) * height
    spacing = 0.2 if edges[-1] < 2 else 0.5 * np.ceil(edges[-1] / 5)
    ticks = np.arange(0, edges[-1], spacing).round(9).tolist()
    return tag(
        "svg",
        bottom_axis(across, ticks, TOP, bottom, "final distance to the goal [m]"),
        tolerance_line(across, task.tolerance, TOP, bottom),
        [
            _row(group, edges, across, (TOP + place * height, TOP + (place + 1) * height))
            for place, group in enumerate(task.groups)
        ],
        viewBox=f"0 0 {WIDTH} {bottom + 44}",
        role="img",
        aria_label=_summary(task),
        class_="chart",
    )


def bin_shares(group: Group, edges: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of a group's trials, of all seeds alike, that ended in each bin.

    Parameters
    ----------
    group : Group
        The group.
    edges : ndarray, shape (n + 1,)
        Edges of the bins [m]; every bin is open at its upper one, but the last.
    """
    counts, _ = np.histogram(group.distances, edges)
    shares: NDArray[np.float64] = counts / group.distances.size
    return shares


def _row(
    group: Group, edges: NDArray[np.float64], across: Axis, ends: tuple[float, float]
) -> Markup:
    """Bars, base line and name of one group, between two heights."""
    top, bottom = ends
    up = Axis(0, 1, bottom, top + GAP, "sqrt")
    shares = bin_shares(group, edges)
    bars = [
        tag(
            "path",
            tag("title", f"{low:.2f} to {high:.2f} m: {100 * share:.2f} % of trials"),
            d=f"M{across(low) + 0.5:.1f},{bottom}V{up(share):.1f}"
            f"H{across(high) - 0.5:.1f}V{bottom}Z",
        )
        for low, high, share in zip(edges[:-1], edges[1:], shares, strict=True)
        if share
    ]
    return tag(
        "g",
        tag("path", d=f"M{LEFT},{bottom}H{RIGHT}", class_="base"),
        tag("text", f"{100 * shares[0]:.1f} %", x=LEFT - 6, y=bottom - 2, class_="tick end"),
        tag("g", bars, class_="bars"),
        tag("text", group.name, x=RIGHT, y=top + GAP + 12, class_="name end"),
        class_=f"series {group.style}",
        data_series=group.name,
    )


def _summary(task: TaskResults) -> str:
    """What the chart shows, for those who cannot see it."""
    figures = (
        f"{group.name} {100 * float((group.distances < BIN_WIDTH).mean()):.1f} %"
        for group in task.groups
    )
    return (
        f"Histograms of the final distance on {task.name}. Share of trials in the first bin, "
        f"below {BIN_WIDTH:g} m: " + "; ".join(figures)
    )
