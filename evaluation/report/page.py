"""The page as a whole."""

from collections.abc import Sequence
from functools import partial
from operator import attrgetter
from pathlib import Path

from kinarm._files import check_folder, write_text
from kinarm.evaluation.document import EvaluationDocument
from kinarm.evaluation.evaluation import Evaluation
from kinarm.evaluation.outcomes import EARLY_STEPS
from kinarm.evaluation.report import charts
from kinarm.evaluation.report.groups import group_results, record_worst, worst_trials
from kinarm.evaluation.report.templating import template_environment
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
    chosen = [worst_trials(results) for results in problems]
    recordings = record_worst([worst for each in chosen for worst in each])
    template = template_environment(autoescape=True).get_template("page.html")
    return template.render(
        protocol=document.protocol,
        problems=problems,
        differences=document.differences,
        difference_columns=difference_columns,
        columns=metric_columns(),
        shown_columns=partial(telling_columns, priority=SPREAD_PRIORITY),
        worst=list(zip(problems, chosen, strict=True)),
        replay=replay_page(recordings).html,
        charts=charts,
        success_cell=metric_column("success", attrgetter("metrics")).cell,
        early_steps=EARLY_STEPS,
    )
