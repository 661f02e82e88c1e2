"""Write what a benchmark measured: a JSON document and a page."""

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from kinarm._files import write_text
from kinarm.evaluation.markdown import markdown_table
from kinarm.evaluation.measurements.table import (
    HEADER,
    OPERATION_HEADER,
    PEER_HEADER,
    TIME_HEADER,
    Row,
    limit_text,
    operation_rows,
    peer_rows,
    rows,
    time_rows,
)

NAME = "speed"
"""Of both files."""


def write_all(document: dict[str, Any], folder: Path, command: str) -> None:
    """Write both files; the command that made them is for the record.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    made = {"command": command, **document}
    write_text(folder / f"{NAME}.json", json.dumps(made, indent=1) + "\n")
    write_text(folder / f"{NAME.upper()}.md", speed_page(document, command))


def speed_page(document: dict[str, Any], command: str) -> str:
    """``SPEED.md``: the tables of everything that was measured."""
    return "\n".join([*_parts(document, command), ""])


def _parts(document: dict[str, Any], command: str) -> Iterator[str]:
    threads, architecture = document["machine"]["threads"], document["machine"]["architecture"]
    yield "# Measured\n"
    yield (
        f"Made by `{command}` on {threads} threads of a machine of type {architecture}, with the "
        f"policy `{document['policy']}`; medians of {document['repetitions']} repetitions.\n"
    )
    if "peers" in document:
        yield "## Peers\n"
        yield markdown_table(PEER_HEADER, peer_rows(document["peers"]))
        yield from _terms(document["peers"])
    if "limits" in document:
        yield "## Operations of a step\n"
        yield limit_text(document) + "\n"
        yield markdown_table(OPERATION_HEADER, operation_rows(document["limits"]))
        yield "## Where time goes\n"
        yield markdown_table(TIME_HEADER, time_rows(document["limits"]))
    yield "## Everything\n"
    yield markdown_table(HEADER, filled(rows(document), len(HEADER)))
    versions = document["versions"].items()
    yield ", ".join(f"{name} {version}" for name, version in versions) + "."


def _terms(comparisons: list[dict[str, Any]]) -> Iterator[str]:
    """What was alike and what was not, once for each peer and wording."""
    told = dict.fromkeys((row["peer"], row["terms"]) for row in comparisons if "terms" in row)
    for peer, terms in told:
        yield f"- **{peer}**: {terms}."
    if told:
        yield ""


def filled(table: Iterable[Row], width: int) -> Iterator[Row]:
    """Rows of one width, without the empty ones; a reason stands in the first column."""
    return ((*row, *[""] * (width - len(row))) for row in table if row)
