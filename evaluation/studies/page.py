"""Everything that is written of a study: tables, figures and a page."""

import io
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import tomli_w

from kinarm._files import write_text
from kinarm.evaluation.figures import save_figure
from kinarm.evaluation.metrics import METRICS
from kinarm.evaluation.report.templating import template_environment
from kinarm.evaluation.studies.figures import draw_all
from kinarm.evaluation.studies.table import FIGURES, Group, write_csv, write_parquet
from kinarm.policies.provenance import package_versions

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from kinarm.evaluation.studies.study import Study

TITLES = {
    "learning_curves": "Learning curves",
    "effects": "Effects",
    "beside_bound": "Beside the bound",
}
CAPTIONS = {
    "learning_curves": (
        "Success in the course of the training. Lines are means over the seeds, bands reach from "
        "the worst seed to the best; dotted is what the oracle reaches. The best settings of each "
        "problem are shown."
    ),
    "effects": (
        "Success by the value of each field that varies: means over everything else, with "
        "intervals over seeds and trials. Fields that were drawn from a range are shown training "
        "by training."
    ),
    "beside_bound": "The best settings of each problem, beside what the oracle reaches (dotted).",
}
"""What the page says about the figures."""


def write_all(study: "Study", command: str = "") -> Path:
    """Write ``index.html``, ``runs.csv``, ``runs.parquet`` if pyarrow is there, and the figures.

    Parameters
    ----------
    study : Study
        The study, some of whose trainings are finished.
    command : str
        The command that made it, for the record.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    folder = study.store.folder
    write_csv(study, folder / "runs.csv")
    if find_spec("pyarrow") is not None:
        write_parquet(study, folder / "runs.parquet")
    figures = draw_all(study)
    for name, figure in figures.items():
        save_figure(figure, folder, name)
    page = folder / "index.html"
    write_text(page, study_page(study, figures, command))
    return page


def study_page(study: "Study", figures: dict[str, "Figure"], command: str = "") -> str:
    """One HTML page that fetches nothing; equal input gives equal text."""
    environment = template_environment(__package__, autoescape=True)
    environment.filters.update(percent=lambda share: f"{100 * share:.1f} %")
    groups = sorted(study.groups(), key=lambda group: -group.relative_success)
    best: dict[str, Group] = {}
    for group in groups:
        best.setdefault(group.config.problem.name, group)
    shown = [(name, METRICS[name].heading, METRICS[name].meaning) for name in FIGURES]
    return environment.get_template("study.html").render(
        specification=study.specification,
        subtitle=_subtitle(study),
        best=best.items(),
        headings=HEADINGS,
        rows=[group_row(group) for group in groups],
        figures=[(name, TITLES[name], _svg(figure)) for name, figure in figures.items()],
        captions=CAPTIONS,
        failures=[(run.name, error) for run, error in study.failures.items()],
        command=command,
        text=tomli_w.dumps(study.specification.to_json()),
        meanings=[(heading or name, meaning) for name, heading, meaning in shown],
        versions=package_versions(),
    )


HEADINGS = (
    *("trainings", "seeds", "success %", "95 %", "worst seed %", "relative success %"),
    *("collision %", "median distance m", "median steps", "step ratio", "million steps"),
)


def group_row(group: Group) -> tuple[str, ...]:
    """What tables say of a group, in the order of ``HEADINGS``."""
    found = group.figures
    low, high = group.success.ci95 or (np.nan, np.nan)
    steps = np.mean([run.last.environment_steps for run in group.runs])
    return (
        group.label,
        str(len(group.runs)),
        METRICS["success"].write(found["success"]),
        METRICS["success"].write_range(low, high).replace("..", "\N{EN DASH}"),
        METRICS["success"].write(float(group.hits.mean(axis=1).min())),
        *(_cell(name, found[name]) for name in FIGURES[1:]),
        f"{steps / 1e6:.2f}",
    )


def _cell(name: str, value: float) -> str:
    return "" if np.isnan(value) else METRICS[name].write(value)


def _subtitle(study: "Study") -> str:
    """A line about the finished share of the study, and about its trials."""
    trials = study.specification.trials
    return (
        f"{len(study)} of {len(study.runs)} trainings · {trials.count} trials each · "
        f"seed {trials.seed}"
    )


def _svg(figure: "Figure") -> str:
    """A figure as an element of the page."""
    import matplotlib

    text = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "kinarm"}):
        figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    drawn = text.getvalue()
    return drawn[drawn.index("<svg") :]
