"""Write what a comparison came to: curves as CSV, a JSON document, a page and figures."""

import json
import math
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from kinarm._fields import to_plain
from kinarm._files import write_text
from kinarm.evaluation.comparison.figures import final_success, learning_curves
from kinarm.evaluation.comparison.learners import OF_OTHERS, ComparedLearner
from kinarm.evaluation.comparison.results import LEVELS, Comparison, Series
from kinarm.evaluation.comparison.runs import CurvePoint
from kinarm.evaluation.figures import save_figure
from kinarm.evaluation.markdown import markdown_table
from kinarm.policies.provenance import package_versions, source_commit

NAME = "learners"
"""Of all files but the figure of what was reached."""

REACHED = "final_success"


def write_all(comparison: Comparison, folder: Path, command: str) -> None:
    """Write all files of a comparison; the command that made them is for the record.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    document = comparison_document(comparison, command)
    write_text(folder / f"{NAME}.json", json.dumps(document, indent=1) + "\n")
    write_text(folder / f"{NAME}.csv", curves_csv(comparison))
    save_figure(learning_curves(comparison), folder, NAME)
    save_figure(final_success(comparison), folder, REACHED)
    write_text(folder / f"{NAME.upper()}.md", comparison_page(comparison, document))


def comparison_document(comparison: Comparison, command: str) -> dict[str, Any]:
    """Settings and results, as a dictionary that JSON can hold."""
    protocol = next(iter(comparison.curves)).protocol
    return {
        "command": command,
        "protocol": asdict(protocol),
        "learners": [to_plain(learner) for learner in _learners(comparison)],
        "reachable": comparison.reachable,
        "results": list(comparison.rows()),
        "commit": source_commit(),
        "versions": package_versions(),
    }


def _learners(comparison: Comparison) -> Iterable[ComparedLearner]:
    """Who was compared."""
    return {series.learner.name: series.learner for series in comparison.series}.values()


def curves_csv(comparison: Comparison) -> str:
    """One line per point of a learning curve."""
    lines: list[tuple[str, ...]] = [("problem", "learner", "seed", "trials", *CurvePoint._fields)]
    for run, curve in comparison.curves.items():
        made = (run.problem.name, run.learner.name, str(run.seed), str(run.protocol.trials))
        lines += [(*made, *map(str, point)) for point in curve]
    return "".join(",".join(line) + "\n" for line in lines)


def comparison_page(comparison: Comparison, document: dict[str, Any]) -> str:
    """``LEARNERS.md``: the table of results, the figures and the table of settings."""
    protocol, versions = document["protocol"], document["versions"].items()
    return "\n".join(
        [
            "# Learners compared\n",
            f"Made by `{document['command']}` at commit {document['commit'] or 'unknown'}. All "
            f"policies faced the same {protocol['trials']} trials a problem, seed "
            f"{protocol['seed']}; in brackets 95 % intervals, of the trials that the seeds share. "
            "Every training had one thread; minutes are processor time without judging.\n",
            markdown_table(HEADER, result_rows(comparison)),
            f"![Success of the trained policies]({REACHED}.png)\n",
            f"![Success against environment steps and against time]({NAME}.png)\n",
            settings_table(_learners(comparison)),
            ", ".join(f"{name} {version}" for name, version in versions) + ".\n",
        ]
    )


def result_rows(comparison: Comparison) -> list[list[str]]:
    """How well trained policies do, and how long they took; means over training seeds."""
    rows: list[list[str]] = []
    for problem, possible in comparison.reachable.items():
        rows += [
            [problem, *_result_cells(series, possible)]
            for series in comparison.series
            if series.problem.name == problem
        ]
        rows.append([problem, "oracle", f"{100 * possible:.1f}", *[""] * (len(HEADER) - 3)])
    return rows


HEADER = (
    *("problem", "learner", "success % (95 %)", "relative success %", "seeds %"),
    *("collision %", "steps to success"),
    *("million steps", "minutes", "steps/s"),
    *(f"thousand steps, minutes to {level:.0%}" for level in LEVELS),
)


def _result_cells(series: Series, possible: float) -> list[str]:
    """What the table of results says of a learner on a problem, of which this share is possible."""
    low, high = series.success.ci95 or (math.nan, math.nan)
    each = " ".join(f"{100 * curve[-1].successes / series.trials:.0f}" for curve in series.curves)
    steps, seconds = series.last("environment_steps"), series.last("processor_seconds")
    return [
        series.learner.title,
        f"{100 * (series.success.value or 0):.1f} ({100 * low:.1f}..{100 * high:.1f})",
        f"{100 * (series.success.value or 0) / max(possible, 1e-9):.1f}",
        each,
        f"{100 * (series.collision.value or 0):.1f}",
        "" if series.steps_to_success is None else f"{series.steps_to_success:.1f}",
        f"{steps / 1e6:.2f}",
        f"{seconds / 60:.2f}",
        f"{steps / max(seconds, 1e-9):,.0f}",
        *(_speed_cell(series, level) for level in LEVELS),
    ]


SPEEDS = ("environment_steps", "processor_seconds")
"""What is told of how fast a learner is."""


def _speed_cell(series: Series, level: float) -> str:
    """Environment steps [thousands] and time [min] until a share of trials succeeds."""
    steps, seconds = (series.until(level, name) for name in SPEEDS)
    return "never" if math.isinf(steps) else f"{steps / 1e3:,.0f}, {seconds / 60:.2f}"


def settings_table(learners: Iterable[ComparedLearner]) -> str:
    """Settings of the learners that are no recipes of kinarm, and where all of them come from."""
    rows = []
    for learner in learners:
        entries = to_plain(learner)
        shown = ("recipe", *OF_OTHERS)
        given = {name: entries[name] for name in shown if entries[name]} | learner.settings
        settings = ", ".join(f"{name} {_shown(value)}" for name, value in given.items())
        rows.append([learner.title, learner.algorithm, settings, learner.source])
    return markdown_table(("learner", "algorithm", "settings", "source"), rows)


def _shown(value: object) -> str:
    """A setting as text."""
    if isinstance(value, dict):
        return " ".join(f"{name} {_shown(entry)}" for name, entry in value.items())
    if value is True:
        return "yes"
    return str(value)
