"""The table of an evaluation, for terminals, Markdown and reports."""

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from kinarm._console import open_console
from kinarm.evaluation.metrics import ALWAYS, METRICS

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

SPREAD_PRIORITY = 5
"""Priority of the columns with ranges over training seeds; see `Metric.priority`."""


class Cell(NamedTuple):
    """A figure as text, empty if there is none, and its interval or other addition."""

    value: str = ""
    beside: str = ""

    def __str__(self) -> str:
        return f"{self.value} ({self.beside})" if self.beside else self.value


@dataclass(frozen=True)
class Column:
    """A column of the table, with the cell of each row of the document.

    Columns of low priority are left out first.
    """

    heading: str
    meaning: str
    priority: float
    cell: Callable[[dict[str, Any]], Cell]


def metric_columns() -> list[Column]:
    """Columns of the `METRICS` that have a heading."""
    columns = []
    for name, metric in METRICS.items():
        if metric.heading:
            cell = partial(metric_cell, name)
            columns.append(Column(metric.heading, metric.meaning, metric.priority, cell))
        if metric.spread_heading:
            meaning = f"range over training seeds, and their number: {metric.meaning}"
            cell = partial(spread_cell, name)
            columns.append(Column(metric.spread_heading, meaning, SPREAD_PRIORITY, cell))
    return columns


def metric_cell(name: str, row: dict[str, Any]) -> Cell:
    """A metric in a row of the document."""
    metric, estimate = METRICS[name], row["metrics"][name]
    if estimate["value"] is None:
        return Cell()
    beside = ""
    if metric.shows_interval and estimate["ci95"]:
        beside = metric.write_range(*estimate["ci95"])
    if metric.beside:
        other, words = metric.beside
        beside = words.format(METRICS[other].write(row["metrics"][other]["value"]))
    return Cell(metric.write(estimate["value"]), beside)


def spread_cell(name: str, row: dict[str, Any]) -> Cell:
    """A metric's range over training seeds in a row of the document; empty without seeds."""
    spread = row.get("spread", {}).get(name)
    if spread is None:
        return Cell()
    extremes = METRICS[name].write_range(spread["min"], spread["max"])
    return Cell(extremes, f"{len(spread['each'])} seeds")


def text_column(key: str) -> Column:
    """Column of a text in a row of the document."""
    return Column(key, "", ALWAYS, lambda row: Cell(row[key]))


def print_table(document: dict[str, Any], console: "Console", *, markdown: bool = False) -> None:
    """Print the figures of a document, without the less important columns if space is scarce.

    Markdown is always printed with all columns that say something.
    """
    rows = [
        row for problem in document["protocol"]["problems"] for row in table_rows(document, problem)
    ]
    figures = [c for c in metric_columns() if any(c.cell(row).value for row in rows)]
    columns = [text_column("problem"), text_column("policy"), *figures]
    if markdown:
        text = io.StringIO()
        open_console(file=text, piped_width=1000).print(
            evaluation_table(document, columns, markdown=True)
        )
        console.out(text.getvalue().strip(), highlight=False)
        return
    expendable = sorted((c for c in columns if c.priority < ALWAYS), key=lambda c: c.priority)
    unbounded = console.options.update(width=1000)
    for count in range(len(expendable) + 1):
        left_out = expendable[:count]
        table = evaluation_table(document, [c for c in columns if c not in left_out])
        if console.measure(table, options=unbounded).maximum <= console.width:
            break
    console.print(table)
    if left_out:
        headings = ", ".join(column.heading for column in left_out)
        note = f"columns that do not fit here: {headings}; --markdown prints all"
        console.print(note, style="dim")


def evaluation_table(
    document: dict[str, Any], columns: Sequence[Column], *, markdown: bool = False
) -> "Table":
    """The figures of a document as a table; several training seeds share a row."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.MARKDOWN if markdown else box.HEAVY_HEAD, header_style="bold")
    for column in columns:
        side: Literal["left", "right"] = "right" if column.meaning else "left"
        table.add_column(column.heading, justify=side, no_wrap=True)
    for problem in document["protocol"]["problems"]:
        if not markdown:
            table.add_section()
        for row in table_rows(document, problem):
            table.add_row(*(str(column.cell(row)) for column in columns))
    return table


def table_rows(document: dict[str, Any], problem: str) -> list[dict[str, Any]]:
    """Pooled results of a problem and the results that are not part of them, best first."""
    pooled = [row for row in document["pooled"] if row["problem"] == problem]
    members = {name for row in pooled for name in row["members"]}
    single = [row for row in document["results"] if row["problem"] == problem]
    rows = pooled + [row for row in single if row["policy"] not in members]
    return sorted(rows, key=lambda row: -row["metrics"]["success"]["value"])
