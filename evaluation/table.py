"""The table of an evaluation, for terminals, Markdown and reports."""

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Literal, NamedTuple

from kinarm._console import open_console, print_fitting
from kinarm.evaluation.document import EvaluationDocument, PooledResult, Row
from kinarm.evaluation.metrics import ALWAYS, METRICS

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

SPREAD_PRIORITY = 5
"""`Metric.priority` of columns with ranges over training seeds."""

REPLACED = "* some settings of the recipe are replaced"
"""Meaning of the star in a label."""


class Cell(NamedTuple):
    """A figure as text, or empty, and its interval or other addition."""

    value: str = ""
    beside: str = ""

    def __str__(self) -> str:
        return f"{self.value} ({self.beside})" if self.beside else self.value


@dataclass(frozen=True)
class Column:
    """A column of the table, with the cell of each row of the document."""

    heading: str
    meaning: str
    priority: float
    cell: Callable[[Row], Cell]


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


def telling_columns(rows: Sequence[Row], priority: float = 0) -> list[Column]:
    """Metric columns of some priority that say something about rows."""
    columns = (column for column in metric_columns() if column.priority >= priority)
    return [column for column in columns if any(column.cell(row).value for row in rows)]


def metric_cell(name: str, row: Row) -> Cell:
    """A metric in a row of the document."""
    metric, estimate = METRICS[name], row.metrics[name]
    if estimate.value is None:
        return Cell()
    beside = ""
    if metric.shows_interval and estimate.ci95:
        beside = metric.write_range(*estimate.ci95)
    if metric.beside:
        other, words = metric.beside
        beside = words.format(METRICS[other].write(row.metrics[other].value or 0.0))
    return Cell(metric.write(estimate.value), beside)


def spread_cell(name: str, row: Row) -> Cell:
    """A metric's range over training seeds; empty without seeds."""
    if not isinstance(row, PooledResult) or name not in row.spread:
        return Cell()
    spread = row.spread[name]
    return Cell(METRICS[name].write_range(spread.min, spread.max), f"{len(spread.each)} seeds")


def policy_label(row: Row) -> str:
    """Name of a row's policy, with the star of replaced settings.

    Names of files lack the star: ``ars-tuned-right`` is ``ars-tuned*-right``.
    """
    plain = row.recipe.removesuffix("*")
    return row.policy.replace(f"{row.algorithm}-{plain}-", f"{row.algorithm}-{row.recipe}-", 1)


def has_star(row: Row) -> bool:
    """Whether the label of a row has the star of replaced settings."""
    return row.recipe.endswith("*") and row.recipe in policy_label(row)


def print_table(
    document: EvaluationDocument, console: "Console", *, markdown: bool = False
) -> None:
    """Print the figures of a document.

    Parameters
    ----------
    document, console : EvaluationDocument, Console
        What to print, and where.
    markdown : bool
        As Markdown with all columns; else some are left out where space is
        scarce.
    """
    rows = [row for problem in document.protocol.problems for row in table_rows(document, problem)]
    columns = [
        Column("problem", "", ALWAYS, lambda row: Cell(row.problem)),
        Column("policy", "", ALWAYS, lambda row: Cell(policy_label(row))),
        *telling_columns(rows),
    ]
    if markdown:
        text = io.StringIO()
        open_console(file=text).print(_evaluation_table(document, columns, markdown=True))
        console.out(text.getvalue().strip(), highlight=False)
        return
    expendable = sorted((c for c in columns if c.priority < ALWAYS), key=lambda c: c.priority)
    print_fitting(
        console,
        lambda left_out: _evaluation_table(
            document, [column for column in columns if column.heading not in left_out]
        ),
        [column.heading for column in expendable],
        "--markdown prints all",
    )


def _evaluation_table(
    document: EvaluationDocument, columns: Sequence[Column], *, markdown: bool = False
) -> "Table":
    """The table of a document; several training seeds share a row."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.MARKDOWN if markdown else box.HEAVY_HEAD, header_style="bold")
    for column in columns:
        side: Literal["left", "right"] = "right" if column.meaning else "left"
        table.add_column(column.heading, justify=side, no_wrap=True)
    for problem in document.protocol.problems:
        if not markdown:
            table.add_section()
        for row in table_rows(document, problem):
            texts = (str(column.cell(row)) for column in columns)
            table.add_row(*(text.replace("*", "\\*") if markdown else text for text in texts))
    return table


def table_rows(document: EvaluationDocument, problem: str) -> list[Row]:
    """Pooled results of a problem and other results, best first."""
    pooled = [row for row in document.pooled if row.problem == problem]
    members = {name for row in pooled for name in row.members}
    single = [row for row in document.results if row.problem == problem]
    rows = (*pooled, *(row for row in single if row.policy not in members))
    return sorted(rows, key=lambda row: -(row.metrics["success"].value or 0.0))
