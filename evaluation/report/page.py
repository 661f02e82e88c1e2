"""The page as a whole."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from kinarm._files import check_folder, write_text
from kinarm.evaluation.contestants import ORACLE
from kinarm.evaluation.document import EvaluationDocument, Protocol
from kinarm.evaluation.evaluation import Evaluation
from kinarm.evaluation.outcomes import EARLY_STEPS
from kinarm.evaluation.report import maps
from kinarm.evaluation.report.charts import histogram_chart, profile_chart
from kinarm.evaluation.report.groups import ProblemResults, count_policies, group_results
from kinarm.evaluation.report.templating import template_environment
from kinarm.evaluation.report.worst import record_worst, worst_row, worst_trials
from kinarm.evaluation.table import (
    REPLACED,
    SPREAD_PRIORITY,
    Column,
    has_star,
    metric_cell,
    metric_columns,
)
from kinarm.viewer import replay_page

if TYPE_CHECKING:
    from jinja2 import Template

MOST_CAUSES = 6
"""Causes of failures that are told of a policy."""


def write_report(
    folder: str | Path, document: EvaluationDocument, evaluations: Sequence[Evaluation]
) -> Path:
    """Write the report of an evaluation as ``index.html``.

    Parameters
    ----------
    folder : str or Path
        Where to; it is created if it is missing.
    document, evaluations
        As for `report_page`.

    Returns
    -------
    Path
        The page.

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

    It holds the table with its intervals drawn, performance profiles, histograms, maps of the
    benches, the worst trials and how everything was made. Equal input gives equal text.

    Parameters
    ----------
    document : EvaluationDocument
        What `evaluation_document` made of the evaluations.
    evaluations : sequence of Evaluation
        Made with one trial set per problem.

    Raises
    ------
    InvalidInputError
        If the document was made of others, or two of them cannot be told apart.
    """
    problems = group_results(document, evaluations)
    chosen = [worst_trials(results) for results in problems]
    recordings = record_worst([worst for each in chosen for worst in each])
    return page_template().render(
        title=_title(problems),
        subtitle=_subtitle(document.protocol, problems),
        protocol=document.protocol,
        problems=problems,
        columns=metric_columns(),
        worst=[
            (results, [worst_row(results, worst) for worst in each])
            for results, each in zip(problems, chosen, strict=True)
        ],
        replay=replay_page(recordings).html,
    )


def page_template() -> "Template":
    """The template of the page, with what it calls."""
    environment = template_environment(autoescape=True)
    environment.filters.update(
        tenth=lambda length: f"{length:.1f}".removesuffix(".0"),
        percent=lambda share: f"{100 * share:.1f} %",
        dashes=lambda text: text.replace("..", "\N{EN DASH}"),
        zip=zip,
    )
    environment.globals.update(
        maps=maps,
        success_cell=partial(metric_cell, "success"),
        profile_chart=profile_chart,
        histogram_chart=histogram_chart,
        shown_columns=shown_columns,
        count_policies=count_policies,
        early_steps=EARLY_STEPS,
        most_causes=MOST_CAUSES,
    )
    return environment.get_template("page.html")


def shown_columns(results: ProblemResults) -> list[Column]:
    """Columns that the page shows of a problem: the important ones that have something to say."""
    return [
        column
        for column in metric_columns()
        if column.priority >= SPREAD_PRIORITY
        and any(column.cell(group.row).value for group in results.groups)
    ]


def _title(problems: Sequence[ProblemResults]) -> str:
    """The policy that was evaluated, or how many rows of the tables are policies."""
    groups = [group for results in problems for group in results.contenders]
    names = {group.name for group in groups}
    if len(names) == 1:
        return names.pop()
    return count_policies(groups) if groups[0].is_policy else " and ".join(sorted(names))


def _subtitle(protocol: Protocol, problems: Sequence[ProblemResults]) -> str:
    """How policies were trained and what is beside them; what was faced."""
    arms = " and ".join(dict.fromkeys(results.entry.arm for results in problems))
    groups = [group for results in problems for group in results.groups]
    said = [
        *_training_seeds(problems),
        *_references(problems),
        f"problem {problems[0].name}" if len(problems) == 1 else f"{len(problems)} problems",
        f"arm {arms}",
        f"{protocol.trials} trials each, seed {protocol.seed}",
        *([REPLACED] if any(has_star(group.row) for group in groups) else []),
    ]
    return " \N{MIDDLE DOT} ".join(said)


def _training_seeds(problems: Sequence[ProblemResults]) -> list[str]:
    """How many training seeds share a row, if any do."""
    groups = [group for results in problems for group in results.contenders]
    fewest, most = (end(len(group.members) for group in groups) for end in (min, max))
    if most == 1:
        return []
    each = " each" if len({group.name for group in groups}) > 1 else ""
    return [f"{most if fewest == most else f'{fewest} to {most}'} training seeds{each}"]


def _references(problems: Sequence[ProblemResults]) -> list[str]:
    """Rows of the tables that are no policies, if there are policies; the oracle last."""
    groups = [group for results in problems for group in results.groups if results.policies]
    names = dict.fromkeys(group.name for group in groups if not group.is_policy)
    words = [name for name in names if name != ORACLE.name]
    words += [f"the {ORACLE.name}"] if ORACLE.name in names else []
    beside = " and ".join(part for part in (", ".join(words[:-1]), *words[-1:]) if part)
    return [f"beside {beside}"] if beside else []
