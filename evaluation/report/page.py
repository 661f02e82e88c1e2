"""The page as a whole."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from kinarm._files import check_folder, write_text
from kinarm.evaluation.contestants import ORACLE
from kinarm.evaluation.document import EvaluationDocument, Protocol
from kinarm.evaluation.evaluation import Evaluation
from kinarm.evaluation.outcomes import EARLY_STEPS
from kinarm.evaluation.report import maps
from kinarm.evaluation.report.charts import histogram_chart, profile_chart
from kinarm.evaluation.report.groups import ProblemResults, count_policies, group_results
from kinarm.evaluation.report.templating import template_environment
from kinarm.evaluation.report.worst import oracle_steps, record_worst, worst_trials
from kinarm.evaluation.table import (
    REPLACED,
    SPREAD_PRIORITY,
    has_star,
    metric_cell,
    metric_columns,
    telling_columns,
)
from kinarm.viewer import replay_page

MOST_CAUSES = 6
"""Causes of failures that are told of a policy."""


def write_report(
    folder: str | Path, document: EvaluationDocument, evaluations: Sequence[Evaluation]
) -> Path:
    """Write the report of an evaluation as ``index.html``, and return its path.

    Parameters
    ----------
    folder : str or Path
        Where to; it is created if it is missing.
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
    environment = template_environment(autoescape=True)
    environment.filters.update(
        tenth=lambda length: f"{length:.1f}".removesuffix(".0"),
        percent=lambda share: f"{100 * share:.1f} %",
        dashes=lambda text: text.replace("..", "\N{EN DASH}"),
    )
    return environment.get_template("page.html").render(
        title=_title(problems),
        subtitle=_subtitle(document.protocol, problems),
        protocol=document.protocol,
        problems=problems,
        columns=metric_columns(),
        shown_columns=partial(telling_columns, priority=SPREAD_PRIORITY),
        worst=list(zip(problems, chosen, strict=True)),
        oracle_steps=oracle_steps,
        replay=replay_page(recordings).html,
        maps=maps,
        success_cell=partial(metric_cell, "success"),
        profile_chart=profile_chart,
        histogram_chart=histogram_chart,
        count_policies=count_policies,
        early_steps=EARLY_STEPS,
        most_causes=MOST_CAUSES,
    )


def _title(problems: Sequence[ProblemResults]) -> str:
    """The policy that was evaluated, or how many rows of the tables are policies."""
    groups = [group for results in problems for group in results.contenders]
    names = {group.name for group in groups}
    if len(names) == 1:
        return names.pop()
    return count_policies(groups) if groups[0].is_policy else " and ".join(sorted(names))


def _subtitle(protocol: Protocol, problems: Sequence[ProblemResults]) -> str:
    """How policies were trained and what is beside them; what was faced."""
    groups = [group for results in problems for group in results.groups]
    sizes = [len(group.members) for results in problems for group in results.contenders]
    fewest, most = min(sizes), max(sizes)
    seeds = f"{most}" if fewest == most else f"{fewest} to {most}"
    beside = {
        group.name: "the oracle" if group.name == ORACLE.name else group.name
        for results in problems
        for group in results.groups
        if results.contenders[0].is_policy and not group.is_policy
    }
    references = sorted(beside.values(), key="the oracle".__eq__)
    said = [
        f"{seeds} training seeds each" if most > 1 else "",
        f"beside {' and '.join(references)}" if references else "",
        f"problem {problems[0].name}" if len(problems) == 1 else f"{len(problems)} problems",
        f"arm {' and '.join(dict.fromkeys(results.entry.arm for results in problems))}",
        f"{protocol.trials} trials each, seed {protocol.seed}",
        REPLACED if any(has_star(group.row) for group in groups) else "",
    ]
    return " \N{MIDDLE DOT} ".join(filter(None, said))
