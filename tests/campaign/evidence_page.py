"""The page that sums the evidence up."""

from collections.abc import Sequence
from typing import Any

Document = dict[str, Any]

TITLES = {
    "steps": ("Steps of the kernels", "arm"),
    "contact": ("Verdicts of contact", "arm or problem"),
    "floors": ("Policies and proven bounds", "arm or problem"),
}
"""Titles of the tables, and what their rows are."""

COLUMNS = {
    "steps": (
        *("steps", "episodes", "successes", "successes as fast as is proven possible"),
        *("contacts", "steps run twice", "steps of the reference"),
    ),
    "contact": (
        *("configurations", "near contact", "touching", "steps refused"),
        *("configurations of the second engine", "touching for Coal alone"),
        *("touching for MuJoCo alone", "configurations at which MuJoCo ends the process"),
        "contacts of a capsule and a box that MuJoCo overlooks",
    ),
    "floors": (
        *("trials", "scenarios", "scenarios whose floor is exact", "successes"),
        "successes as fast as is proven possible",
    ),
}
"""Counts that each table shows."""


def evidence_page(documents: Sequence[Document], wanted: dict[str, int]) -> str:
    """Write the page, in Markdown.

    Parameters
    ----------
    documents : sequence of dict
        What is recorded of the parts.
    wanted : dict of int
        How many steps, configurations and trials there are when all is done, by kind.
    """
    lines = ["# Evidence", "", "One file a part lies beside this page.", ""]
    for kind, (title, rows) in TITLES.items():
        found = [document for document in documents if document["kind"] == kind]
        if found:
            unit = COLUMNS[kind][0]
            done = sum(document["counts"][unit] for document in found)
            state = f"Recorded: {done:,} {unit} of the {wanted[kind]:,} that are planned."
            lines += [f"## {title}", "", state, ""]
            lines += [*_table(found, rows, COLUMNS[kind]), "", *_claims(found)]
    return "\n".join(lines)


def _table(documents: Sequence[Document], rows: str, columns: Sequence[str]) -> list[str]:
    """One row a part, and the sums."""
    counts = [[document["counts"].get(name, 0) for name in columns] for document in documents]
    sums = [sum(column) for column in zip(*counts, strict=True)]
    names = [*(document["name"] for document in documents), "**all**"]
    body = (
        f"| {name} | " + " | ".join(f"{count:,}" for count in row) + " |"
        for name, row in zip(names, [*counts, sums], strict=True)
    )
    return [f"| {rows} | {' | '.join(columns)} |", "|" + "---|" * (1 + len(columns)), *body]


def _claims(documents: Sequence[Document]) -> list[str]:
    """What was checked how often, and how often it did not hold."""
    checked, failed, measured = {}, {}, {}
    for document in documents:
        for claim, count in document["checked"].items():
            checked[claim] = checked.get(claim, 0) + count
            failed[claim] = failed.get(claim, 0) + document["failed"].get(claim, 0)
        for name, value in document["measures"].items():
            measured[name] = max(measured.get(name, 0.0), value)
    lines = ["| claim | checked | did not hold |", "|---|---|---|"]
    lines += [f"| {claim} | {count:,} | {failed[claim]:,} |" for claim, count in checked.items()]
    lines += [f"\nLargest {name}: {value:.2g}" for name, value in measured.items()]
    return [*lines, ""]
