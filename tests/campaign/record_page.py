"""The table that sums a record of the campaign up, for the documentation."""

from collections.abc import Mapping
from numbers import Real
from pathlib import Path
from typing import Any

TITLES = {
    "peak_memory": "memory at its highest [MB]",
    "slowest_end": "slowest end [s]",
    "before_kinarm": "in Python's own start",
    "ends": "ran to their end",
    "acts": "hostile visits",
    "polite_visits": "polite visits",
    "undisturbed": "page and scene before, slowest [s]",
    "median_answer": "meanwhile, median [s]",
    "slowest_answer": "slowest [s]",
    "memory": "memory before [MB]",
    "files": "open files before",
    "files_left": "after",
}
"""Titles of columns that are not called as in the record."""


def record_page(parts: Mapping[str, Mapping[str, Any]]) -> str:
    """One row a part, and the sums or, of what was measured, the largest; in Markdown."""
    rows = {name: _numbers(part) for name, part in sorted(parts.items())}
    columns = list(next(iter(rows.values())))
    total = {
        column: (max if isinstance(values[0], float) else sum)(values)
        for column in columns
        for values in [[row[column] for row in rows.values()]]
    }
    lines = [
        ["", *(TITLES.get(column, column) for column in columns)],
        ["---"] * (1 + len(columns)),
        *([name, *map(_cell, row.values())] for name, row in rows.items()),
    ]
    if len(rows) > 1:
        lines.append(["**all**", *map(_cell, total.values())])
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def write_page(record: Path, parts: Mapping[str, Mapping[str, Any]]) -> None:
    """Write it beside the record."""
    record.with_suffix(".md").write_text(record_page(parts))


def _numbers(part: Mapping[str, Any]) -> dict[str, float]:
    """What was counted and measured of a part, and how many findings there were."""
    counted = {name: value for name, value in part.items() if isinstance(value, Real)}
    return {**counted, "findings": sum(part["findings"].values())}


def _cell(value: float) -> str:
    return f"{value:,}"
