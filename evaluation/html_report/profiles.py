"""Chart of the performance profiles: the share of trials within each distance."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.evaluations import WITHIN
from kinarm.evaluation.html_report.axes import (
    Axis,
    bottom_axis,
    left_axis,
    log_ticks,
    tolerance_line,
)
from kinarm.evaluation.html_report.groups import Group, TaskResults
from kinarm.evaluation.html_report.markup import Markup, points, tag
from kinarm.evaluation.statistics import performance_profile

WIDTH, HEIGHT = 460, 330
LEFT, RIGHT, TOP, BOTTOM = 46, 448, 14, 286

POINTS = 121
"""Distances at which a profile is drawn, beside the tolerance and those of the table."""


def profile_chart(task: TaskResults) -> Markup:
    """Draw the profiles of a task with their 95 % bands.

    Parameters
    ----------
    task : TaskResults
        The task; its oracle is drawn, too, if it took part.
    """
    limits = profile_limits(task)
    across = Axis(limits[0], limits[-1], LEFT, RIGHT, "log")
    up = Axis(0, 1, BOTTOM, TOP)
    ticks = log_ticks(limits[0], limits[-1])
    return tag(
        "svg",
        left_axis(up, [0, 0.25, 0.5, 0.75, 1], LEFT, RIGHT),
        bottom_axis(across, ticks, TOP, BOTTOM, "distance d to the goal [m], logarithmic"),
        tolerance_line(across, task.tolerance, TOP, BOTTOM),
        # The best comes last, on top.
        [_profile(group, limits, across, up) for group in reversed(task.groups)],
        viewBox=f"0 0 {WIDTH} {HEIGHT}",
        role="img",
        aria_label=_summary(task),
        class_="chart",
    )


def profile_limits(task: TaskResults) -> NDArray[np.float64]:
    """Distances at which the profiles of a task are drawn [m], ascending."""
    furthest = max(float(group.distances.max()) for group in task.groups)
    low, high = task.tolerance / 5, max(furthest, 2 * task.tolerance)
    named = [limit for limit in (task.tolerance, *WITHIN) if low <= limit <= high]
    return np.unique(np.concatenate([np.geomspace(low, high, POINTS), named]))


def _profile(group: Group, limits: NDArray[np.float64], across: Axis, up: Axis) -> Markup:
    """Band and line of one group."""
    shares = performance_profile(_stacked(group), limits)
    rates, low, high = (
        up(np.array(column))
        for column in zip(*((share.rate, *share.ci95) for share in shares), strict=True)
    )
    xs = across(limits)
    band = points([*xs, *xs[::-1]], [*high, *low[::-1]]) + "Z"
    return tag(
        "g",
        tag("title", group.name),
        tag("path", d=band, class_="band"),
        tag("path", d=points(xs, rates), class_="line"),
        class_=f"series {group.style}",
        data_series=group.name,
    )


def _stacked(group: Group) -> NDArray[np.float64]:
    """Distances with an axis for seeds where there are several."""
    return group.distances if len(group.members) > 1 else group.distances[0]


def _summary(task: TaskResults) -> str:
    """What the chart shows, for those who cannot see it."""
    figures = (
        f"{group.name}: {100 * float((group.distances <= task.tolerance).mean()):.1f} %"
        for group in task.groups
    )
    return (
        f"Performance profiles on {task.name}. Share of trials within {task.tolerance:g} m: "
        + "; ".join(figures)
    )


def legend(groups: Sequence[Group]) -> Markup:
    """Names of groups beside samples of their lines."""
    return tag(
        "ul",
        [
            tag(
                "li",
                swatch(group),
                tag("span", group.name),
                data_series=group.name,
            )
            for group in groups
        ],
        class_="legend",
    )


def swatch(group: Group) -> Markup:
    """A sample of the line of a group."""
    line = tag("path", d="M1,5H25", class_="line")
    return tag(
        "svg",
        line,
        viewBox="0 0 26 10",
        class_=f"swatch series {group.style}",
        aria_hidden="true",
    )
