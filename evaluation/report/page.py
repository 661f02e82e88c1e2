"""The page as a whole."""

from collections.abc import Sequence
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Any

from kinarm._files import check_folder, write_text
from kinarm.evaluation.document import EvaluationDocument
from kinarm.evaluation.evaluation import Evaluation
from kinarm.evaluation.outcomes import EARLY_STEPS
from kinarm.evaluation.report import charts
from kinarm.evaluation.report.groups import (
    ProblemResults,
    group_results,
    record_worst,
    worst_trials,
)
from kinarm.evaluation.report.templating import template
from kinarm.evaluation.table import (
    SPREAD_PRIORITY,
    difference_columns,
    metric_column,
    metric_columns,
    telling_columns,
)
from kinarm.viewer import replay_page


def write_report(
    folder: str | Path, document: EvaluationDocument, evaluations: Sequence[Evaluation]
) -> Path:
    """Write the report as ``index.html``, and return its path.

    Parameters
    ----------
    folder : str or Path
        Where to; it is created if missing.
    document, evaluations
        As for `report_page`.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    check_folder(folder)
    path = Path(folder) / "index.html"
    write_text(path, report_page(document, evaluations))
    return path


def report_page(document: EvaluationDocument, evaluations: Sequence[Evaluation]) -> str:
    """The report of an evaluation: one HTML page that fetches nothing.

    It holds the table, profiles, histograms, maps of the benches, the worst
    trials and how everything was made. Equal input gives equal text.

    Parameters
    ----------
    document : EvaluationDocument
        What `evaluation_document` made of the evaluations.
    evaluations : sequence of Evaluation
        Made with one trial set per problem.

    Raises
    ------
    InvalidInputError
        If the document is of others, or two of them cannot be told apart.
    """
    problems = group_results(document, evaluations)
    return template("page.html").render(
        protocol=document.protocol,
        problems=problems,
        differences=document.differences,
        difference_columns=difference_columns,
        columns=metric_columns(),
        shown_columns=partial(telling_columns, priority=SPREAD_PRIORITY),
        theatres=_theatres(problems),
        charts=charts,
        success_cell=metric_column("success", attrgetter("metrics")).cell,
        early_steps=EARLY_STEPS,
    )


def _theatres(problems: Sequence[ProblemResults]) -> list[tuple[list[Any], str]]:
    """Problems with their worst trials, and a replay of these, for each arm and scene."""
    shared: dict[Any, list[Any]] = {}
    for results in problems:
        problem = results.trials.problem
        place = shared.setdefault((problem.arm_digest, problem.scene), [])
        place.append((results, worst_trials(results)))
    return [
        (each, replay_page(record_worst([row for _, rows in each for row in rows])).html)
        for each in shared.values()
    ]
