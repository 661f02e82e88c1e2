"""The page as a whole."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kinarm.evaluation.evaluation import Evaluation
from kinarm.evaluation.metrics import METRICS
from kinarm.evaluation.report import maps
from kinarm.evaluation.report.charts import histogram_chart, profile_chart
from kinarm.evaluation.report.groups import TaskResults, group_results
from kinarm.evaluation.report.worst import record_worst, worst_row, worst_trials
from kinarm.evaluation.table import SPREAD_PRIORITY, Column, metric_cell, metric_columns
from kinarm.files import check_folder, write_text
from kinarm.viewer import replay_page

if TYPE_CHECKING:
    from jinja2 import Template


REPORT_PRIORITY = SPREAD_PRIORITY
"""Priority of the least important columns that the page shows; see `Metric.priority`."""


def write_report(
    folder: str | Path, document: dict[str, Any], evaluations: Sequence[Evaluation]
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
    check_folder(folder, create=True)
    path = Path(folder) / "index.html"
    write_text(path, report_page(document, evaluations))
    return path


def report_page(document: dict[str, Any], evaluations: Sequence[Evaluation]) -> str:
    """The report of an evaluation: one HTML page that fetches nothing.

    It holds the table with its intervals drawn, performance profiles, histograms, maps of the
    benches, the worst trials and how everything was made. Equal input gives equal text.

    Parameters
    ----------
    document : dict
        What `evaluation_document` made of the evaluations.
    evaluations : sequence of Evaluation
        Made with one trial set per task.

    Raises
    ------
    InvalidInputError
        If the document was made of others, or two of them cannot be told apart.
    """
    tasks = group_results(document, evaluations)
    chosen = [worst_trials(task) for task in tasks]
    recordings = record_worst([worst for each in chosen for worst in each])
    return page_template().render(
        title=_title(tasks),
        subtitle=_subtitle(document["protocol"]),
        protocol=document["protocol"],
        tasks=tasks,
        columns=metric_columns(),
        worst=[
            (task, [worst_row(task, worst) for worst in each])
            for task, each in zip(tasks, chosen, strict=True)
        ],
        replay=replay_page(recordings).html,
    )


def page_template() -> "Template":
    """The template of the page, with what it calls."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader(__package__),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    environment.filters.update(
        tenth=lambda length: f"{length:.1f}".removesuffix(".0"),
        percent=lambda share: f"{100 * share:.1f} %",
        dashes=lambda text: text.replace("..", "\N{EN DASH}"),
        zip=zip,
    )
    environment.globals.update(
        maps=maps,
        success_cell=lambda row: metric_cell("success", METRICS["success"], row),
        profile_chart=profile_chart,
        histogram_chart=histogram_chart,
        shown_columns=shown_columns,
    )
    return environment.get_template("page.html")


def shown_columns(task: TaskResults) -> list[Column]:
    """Columns that the page shows of a task: the important ones that have something to say."""
    return [
        column
        for column in metric_columns()
        if column.priority >= REPORT_PRIORITY
        and any(column.cell(group.row).value for group in task.groups)
    ]


def _title(tasks: Sequence[TaskResults]) -> str:
    """The policy that was evaluated, or how many there were."""
    groups = [group for task in tasks for group in task.contenders]
    names = {group.name for group in groups}
    if len(names) == 1:
        return names.pop()
    members = {member.entrant.name for group in groups for member in group.members}
    return f"{len(members)} policies" if groups[0].is_policy else " and ".join(sorted(names))


def _subtitle(protocol: dict[str, Any]) -> str:
    tasks = list(protocol["tasks"])
    kinds = f"task {tasks[0]}" if len(tasks) == 1 else f"{len(tasks)} tasks"
    return (
        f"{kinds} · {protocol['trials']} trials each · arm {protocol['arm']} · "
        f"seed {protocol['seed']}"
    )
