"""The table of an evaluation, for terminals, Markdown and reports."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from operator import attrgetter
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from kinarm._tables import ALWAYS, CHOOSE, Column, print_columns, print_markdown
from kinarm.evaluation.document import Difference, EvaluationDocument, PooledResult, Row
from kinarm.evaluation.metrics import METRICS
from kinarm.evaluation.statistics import Estimate

if TYPE_CHECKING:
    from rich.console import Console

T = TypeVar("T")

SEEDS_PRIORITY, SPREAD_PRIORITY, ON_REQUEST = 16, 5, -1
"""`Metric.priority` of the number of seeds, of ranges over them, and of what ``--columns`` adds."""


class Cell(NamedTuple):
    """A figure as text, or empty, and its interval or other addition."""

    value: str = ""
    beside: str = ""

    def __str__(self) -> str:
        return f"{self.value} ({self.beside})" if self.beside else self.value


def metric_column(name: str, estimates: Callable[[T], Mapping[str, Estimate]]) -> Column[T]:
    """The column of a metric, of rows that have estimates by metric."""
    metric = METRICS[name]

    def cell(row: T) -> Cell:
        known = estimates(row)
        value, ci95 = known[name].value, known[name].ci95
        if value is None:
            return Cell()
        beside = metric.write_range(*ci95) if metric.shows_interval and ci95 else ""
        if metric.beside and metric.beside[0] in known:
            other, words = metric.beside
            beside = words.format(METRICS[other].write(known[other].value or 0.0))
        return Cell(metric.write(value), beside)

    heading = metric.heading or f"{name.replace('_', ' ')} {metric.unit}".rstrip()
    priority = metric.priority if metric.heading else ON_REQUEST
    return Column(heading, cell, name, metric.meaning, priority)


def difference_cell(name: str, difference: Estimate) -> Cell:
    """A metric's difference with its sign, and its interval; empty without one."""
    value, ci95 = difference.value, difference.ci95
    if value is None or ci95 is None:
        return Cell()
    return Cell(METRICS[name].write(value, sign="+"), METRICS[name].write_range(*ci95, sign="+"))


def difference_columns(
    rows: Sequence[Difference], names: Collection[str] = ()
) -> list[Column[Difference]]:
    """Labels, and what rows know of some figures, or of those that tables show with intervals."""
    references = {row.reference for row in rows}
    alone = len(references) == 1

    def label(row: Difference) -> str:
        return row.policy if alone else f"{row.policy} less {row.reference}"

    figures: list[Column[Difference]] = [
        replace(metric_column(name, attrgetter("metrics")), cell=cell)
        for name, each in METRICS.items()
        if (name in names if names else each.shows_interval)
        for cell in [lambda row, name=name: difference_cell(name, row.metrics[name])]
    ]
    return [
        Column("problem", attrgetter("problem"), priority=ALWAYS, words=True),
        Column(f"less {references.pop()}" if alone else "less", label, priority=ALWAYS, words=True),
        *(each for each in figures if any(str(each.cell(row)) for row in rows)),
    ]


def _seeds(row: Row) -> Cell:
    """Number of training seeds."""
    return Cell(str(len(row.members))) if isinstance(row, PooledResult) else Cell()


def _success_range(row: Row) -> Cell:
    """Success of the worst and of the best training seed."""
    if not isinstance(row, PooledResult) or "success" not in row.spread:
        return Cell()
    each = row.spread["success"]
    return Cell(METRICS["success"].write_range(each.min, each.max))


def all_columns() -> list[Column[Row]]:
    """Every column that there can be: labels, the number of seeds, and the `METRICS`."""
    columns: list[Column[Row]] = [
        Column("problem", attrgetter("problem"), priority=ALWAYS, words=True),
        Column("policy", attrgetter("policy"), priority=ALWAYS, words=True),
    ]
    success, *others = (metric_column(name, attrgetter("metrics")) for name in METRICS)
    meaning = "trainings of a recipe that differ in their seed alone"
    seeds = Column("seeds", _seeds, meaning=meaning, priority=SEEDS_PRIORITY)
    meaning = "range over training seeds: " + METRICS["success"].meaning
    heading = "worst..best seed %"
    spread = Column(heading, _success_range, "success_range", meaning, SPREAD_PRIORITY)
    return [*columns, success, seeds, spread, *others]


def metric_columns() -> list[Column[Row]]:
    """Columns of figures that nobody has to ask for."""
    return [each for each in all_columns() if each.meaning and each.priority > ON_REQUEST]


def telling_columns(rows: Sequence[Row], priority: float = 0) -> list[Column[Row]]:
    """Metric columns of some priority that say something about rows."""
    columns = (column for column in metric_columns() if column.priority >= priority)
    return [column for column in columns if any(str(column.cell(row)) for row in rows)]


def print_table(
    document: EvaluationDocument,
    console: "Console",
    *,
    markdown: bool = False,
    columns: Sequence[Column[Row]] = (),
) -> None:
    """Print the figures of a document.

    Parameters
    ----------
    document, console : EvaluationDocument, Console
        What to print, and where.
    markdown : bool
        As Markdown with all columns; else some are left out where space is
        scarce.
    columns : sequence of Column
        Columns to print, all of them, instead of those that say something.
    """

    def show(chosen: Sequence[Column[T]], groups: Sequence[Sequence[T]]) -> None:
        if markdown:
            print_markdown(chosen, [*chain(*groups)], console)
        else:
            print_columns(chosen, groups, console, whole=bool(columns), advice=CHOOSE)

    groups = [table_rows(document, problem) for problem in document.protocol.problems]
    labels = (column for column in all_columns() if column.is_label)
    show(columns or [*labels, *telling_columns([*chain(*groups)])], groups)
    names = [each.name for each in columns or (metric_columns() if markdown else ())]
    compared = difference_columns(document.differences, names)
    if not all(column.is_label for column in compared):
        console.print()
        show(compared, [document.differences])


def table_rows(document: EvaluationDocument, problem: str) -> list[Row]:
    """Pooled results of a problem and other results, best first."""
    pooled = [row for row in document.pooled if row.problem == problem]
    members = {name for row in pooled for name in row.members}
    single = [row for row in document.results if row.problem == problem]
    rows = (*pooled, *(row for row in single if row.policy not in members))
    return sorted(rows, key=lambda row: -(row.metrics["success"].value or 0.0))
