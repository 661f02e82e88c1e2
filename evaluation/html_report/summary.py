"""The table of a task, with every interval drawn, and the best policies at the top of the page."""

from typing import Any

from kinarm.evaluation.html_report.groups import Group, TaskResults
from kinarm.evaluation.html_report.markup import DASH, Markup, join, number, tag
from kinarm.evaluation.html_report.profiles import swatch
from kinarm.evaluation.report import table_cells

HEADINGS = {
    "success %": "share of trials that ended within the tolerance, without contact",
    "of oracle %": "success in per cent of the oracle's",
    "seeds: range %": "number of training seeds, and their lowest and highest success",
    "median m": "median of the final distance",
    "contact %": "share of trials that ended in contact",
    "step ratio": "steps over the number proven necessary, of trials that succeeded: median",
}
"""Columns that the page shows of the table's, and what they mean."""

BAR = 120
"""Width of an interval bar in units of its SVG; 0 to 100 %."""


def summary_table(task: TaskResults) -> Markup:
    """The rows of the table of a task; its figures are written as there.

    Parameters
    ----------
    task : TaskResults
        The task.
    """
    shown = {
        heading: meaning
        for heading, meaning in HEADINGS.items()
        if any(table_cells(group.row)[heading] for group in task.groups)
    }
    heads = [
        tag("th", heading, scope="col", role="columnheader", title=meaning, class_="figure")
        for heading, meaning in shown.items()
    ]
    first = tag("th", "policy", scope="col", role="columnheader")
    drawn = tag("th", _scale(), scope="col", role="columnheader", aria_label="success, drawn")
    bound = oracle_rate(task)
    return tag(
        "table",
        tag("caption", f"Policies on {task.name}, best first", class_="hidden"),
        tag("thead", tag("tr", first, drawn, heads, role="row"), role="rowgroup"),
        tag("tbody", [_row(group, list(shown), bound) for group in task.groups], role="rowgroup"),
        class_="summary",
        role="table",
    )


def oracle_rate(task: TaskResults) -> float | None:
    """Share of the trials that the oracle solved, if it was asked."""
    return task.entry["oracle"]["success"]["rate"] if task.entry["oracle"] else None


def _row(group: Group, headings: list[str], bound: float | None) -> Markup:
    cells = table_cells(group.row)
    figures = [
        tag("td", figure(cells[heading]), role="cell", class_="figure", data_label=heading)
        for heading in headings
    ]
    bar = tag("td", interval_bar(group.row["success"], bound, group.style), role="cell")
    name = tag("th", swatch(group), tag("span", group.name), scope="row", role="rowheader")
    kind = "policy" if group.is_policy else "reference"
    return tag("tr", name, bar, figures, role="row", class_=kind, data_series=group.name)


def _scale() -> Markup:
    """Ends of the interval bars."""
    ends = [
        tag("text", text, x=BAR * share, y=10, class_=f"scale {anchor}")
        for share, text, anchor in ((0, "0", "start"), (1, "100 %", "end"))
    ]
    return tag("svg", ends, viewBox=f"-5 0 {BAR + 10} 14", class_="bar", aria_hidden="true")


def figure(text: str) -> Markup:
    """A figure of the table, with its interval or whatever else belongs to it set smaller."""
    seeds, colon, spread = text.partition(": ")
    value, _, rest = (spread, "", f"{seeds} seeds") if colon else text.partition(" (")
    value, rest = (part.removesuffix(")").replace("..", DASH) for part in (value, rest))
    parts = (("span", value, "value"), ("small", rest, None))
    return join(tag(name, part, class_=style) for name, part, style in parts if part)


def interval_bar(share: dict[str, Any], bound: float | None, style: str) -> Markup:
    """A share as a dot within its interval, from 0 to 100 %, with the oracle's as a mark.

    Parameters
    ----------
    share : dict
        ``rate`` and ``ci95``.
    bound : float or None
        The oracle's share.
    style : str
        Classes that colour it.
    """
    low, high = (BAR * end for end in share["ci95"])
    mark = None if bound is None else f"M{number(BAR * bound)},1V13"
    return tag(
        "svg",
        tag("path", d=f"M0,7H{BAR}", class_="track"),
        tag("path", d=mark, class_="bound") if mark else None,
        tag("path", d=f"M{number(low)},7H{number(high)}", class_="interval"),
        tag("circle", cx=BAR * share["rate"], cy=7, r=3.5),
        viewBox=f"-5 0 {BAR + 10} 14",
        class_=f"bar series {style}",
        aria_hidden="true",
    )


def card(task: TaskResults) -> Markup:
    """The best of a task in large figures, as a link to the rest."""
    best = task.contenders[0]
    cells = table_cells(best.row)
    share, interval = cells["success %"].replace("..", DASH).split(" ", 1)
    beside = f"; the oracle {100 * rate:.1f} %" if (rate := oracle_rate(task)) is not None else ""
    return tag(
        "a",
        tag("span", task.name, class_="task"),
        tag("span", share, tag("small", " %"), class_="big"),
        interval_bar(best.row["success"], rate, best.style),
        tag("span", f"reached by {best.name} {interval}{beside}", class_="note"),
        href=f"#{task.name}",
        class_="card",
    )
