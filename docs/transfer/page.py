"""The tables of a study of transfer, in Markdown, from its document."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from kinarm.evaluation.report.templating import markdown_table

ZERO_SHOT = (
    *("learner", "on", "as it is: success % (95 %)", "collision %"),
    *("reflected: success % (95 %)", "trained there: success % (95 %)"),
    "as it is - trained there (95 %)",
)
UNTIL = (
    *("learner", "on", "length", "success"),
    *("warm: thousand steps (iterations)", "from scratch: thousand steps (iterations)"),
    *("warm / scratch (95 %)", "probability that warm is faster (95 %)", "warm start is"),
)
AT_THE_END = (
    *("learner", "on", "length", "iterations", "warm: success % (95 %)"),
    *("from scratch: success % (95 %)", "difference (95 %)", "warm start is"),
)
REFLECTION = (
    *("learner", "problem", "trials", "largest deviation of a joint [rad]"),
    "trials that end otherwise",
)


def transfer_page(document: Mapping[str, Any], figure: str) -> str:
    """``TRANSFER.md``: the tables and the figure of a document, in a file of this name."""
    protocol, versions = document["protocol"], document["versions"].items()
    source = document["source"]
    return "\n".join(
        [
            "# Transfer\n",
            f"Made by `{document['command']}` at commit {document['commit'] or 'unknown'}: "
            f"{document['trainings']} trainings, {document['seeds']} seeds of each kind, "
            f"{document['environment_steps']:,} environment steps. Policies are from trainings on "
            f"`{source}`. Trained policies faced {protocol['trials']:,} trials a problem, seed "
            f"{protocol['seed']}; those in training {protocol['look_trials']:,}, seed "
            f"{protocol['look_seed']}.\n",
            "## As they are, and reflected\n",
            markdown_table(ZERO_SHOT, _zero_shot_rows(document["zero_shot"])),
            "## With a warm start\n",
            markdown_table(UNTIL, _until_rows(document["warm_start"])),
            f"![Success against environment steps]({figure})\n",
            "## At the end\n",
            markdown_table(AT_THE_END, _end_rows(document["warm_start"])),
            "## By reflection\n",
            markdown_table(REFLECTION, _reflection_rows(document["reflection"])),
            ", ".join(f"{name} {version}" for name, version in versions) + ".\n",
        ]
    )


def _zero_shot_rows(rows: Sequence[Mapping[str, Any]]) -> Iterator[list[str]]:
    """One row per learner and problem."""
    reflected = {
        (row["learner"], row["problem"]): row["success"]
        for row in rows
        if row["way"] == "reflected"
    }
    for row in rows:
        if row["way"] == "as it is":
            yield [
                row["learner"].upper(),
                f"`{row['problem']}`",
                _percent(row["success"]),
                f"{100 * row['collision']['value']:.1f}",
                _percent(reflected[row["learner"], row["problem"]]),
                _percent(row["from_scratch"]),
                _percent(row["difference"], sign="+"),
            ]


def _until_rows(rows: Sequence[Mapping[str, Any]]) -> Iterator[list[str]]:
    """One row per learner, problem, length and level that a training came to."""
    for row in rows:
        for until in row["until"]:
            seeds = until["warm"]["iteration"] + until["scratch"]["iteration"]
            if all(iteration is None for iteration in seeds):
                continue
            faster = until["warm_is_faster"]
            yield [
                *_what(row),
                f"{until['success']:.0%}",
                *(_median(until[role]) for role in ("warm", "scratch")),
                _number(until["ratio"]),
                _number(faster),
                _verdict(faster, 0.5, "faster", "slower"),
            ]


def _end_rows(rows: Sequence[Mapping[str, Any]]) -> Iterator[list[str]]:
    """One row per learner, problem and length."""
    for row in rows:
        yield [
            *_what(row),
            str(row["iterations"]),
            *(_percent(row[role]) for role in ("warm", "scratch")),
            _percent(row["difference"], sign="+"),
            _verdict(row["difference"], 0.0, "better", "worse"),
        ]


def _reflection_rows(rows: Sequence[Mapping[str, Any]]) -> Iterator[list[str]]:
    """One row per learner and problem."""
    for row in rows:
        yield [
            row["learner"].upper(),
            f"`{row['problem']}`",
            f"{row['trials']:,}",
            f"{row['deviation']:.1e}",
            str(row["differing"]),
        ]


def _what(row: Mapping[str, Any]) -> list[str]:
    """Which trainings a row is about."""
    return [row["learner"].upper(), f"`{row['problem']}`", f"{row['length']:g}"]


def _median(seeds: Mapping[str, Sequence[int | None]]) -> str:
    """Medians over the seeds, and how many got there at all."""
    medians = [
        float(np.median([np.inf if number is None else number for number in seeds[quantity]]))
        for quantity in ("environment_steps", "iteration")
    ]
    numbers = seeds["iteration"]
    there = sum(number is not None for number in numbers)
    if not there:
        return "never"
    steps, iterations = medians
    middle = "most never" if np.isinf(steps) else f"{steps / 1e3:,.0f} ({iterations:g})"
    return middle if there == len(numbers) else f"{middle}, {there} of {len(numbers)} seeds"


def _percent(estimate: Mapping[str, Any] | None, sign: str = "") -> str:
    """A share, or a difference of shares, and its interval."""
    return _number(estimate, f"{sign}.1f", 100.0)


def _number(estimate: Mapping[str, Any] | None, shown: str = ".2f", times: float = 1.0) -> str:
    """A number and its interval; empty if it is not known."""
    if estimate is None or estimate["value"] is None:
        return ""
    text = format(times * estimate["value"], shown)
    if estimate["ci95"] is None:
        return text
    low, high = (format(times * end, shown) for end in estimate["ci95"])
    return f"{text} ({low}..{high})"


def _verdict(estimate: Mapping[str, Any], threshold: float, above: str, below: str) -> str:
    """On which side of a threshold the interval lies."""
    low, high = estimate["ci95"] or (threshold, threshold)
    return above if low > threshold else below if high < threshold else "undecided"
