"""Everything that is written of an experiment: tables, figures and a page."""

import csv
import io
import json
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomli_w

from kinarm._files import write_atomically, write_text
from kinarm.errors import MissingExtraError
from kinarm.evaluation.experiments.figures import draw_all
from kinarm.evaluation.experiments.results import FIGURES, Group, shown
from kinarm.evaluation.experiments.table import curve_rows, group_entries, group_row, headings
from kinarm.evaluation.figures import save_figure
from kinarm.evaluation.markdown import markdown_table
from kinarm.evaluation.metrics import METRICS
from kinarm.evaluation.report.templating import template_environment
from kinarm.policies.provenance import package_versions, source_commit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from kinarm.evaluation.experiments.study import Study

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
    """Write what a study came to: page, tables, document and figures.

    They are ``index.html``, ``RESULTS.md``, ``results.json``, ``runs.csv``, ``curves.csv``,
    ``runs.parquet`` if pyarrow is there, and the figures.

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
    write_csv(folder / "runs.csv", study.rows())
    write_csv(folder / "curves.csv", curve_rows(study))
    if find_spec("pyarrow") is not None:
        write_parquet(study, folder / "runs.parquet")
    figures = draw_all(study)
    for name, figure in figures.items():
        save_figure(figure, folder, name)
    document = results_document(study, command)
    write_text(folder / "results.json", json.dumps(document, indent=1) + "\n")
    write_text(folder / "RESULTS.md", results_page(study, document, figures))
    page = folder / "index.html"
    write_text(page, study_page(study, figures, command))
    return page


def write_csv(path: Path, rows: list[dict[str, Any]]) -> None:
    """Write one line per row.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]) if rows else ["key"], lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _cell(value) for name, value in row.items()} for row in rows)
    write_text(path, text.getvalue())


def _cell(value: Any) -> Any:
    return shown(value) if isinstance(value, list | tuple) else value


def write_parquet(study: "Study", path: Path) -> None:
    """Write one row per finished training.

    Raises
    ------
    MissingExtraError
        If pyarrow is not installed.
    OutputError
        If the file cannot be written.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise MissingExtraError("pyarrow", "study") from error
    table = study.table()
    arrow = pyarrow.table({name: table[name] for name in table.dtype.names or ()})
    write_atomically(path, lambda file: pyarrow.parquet.write_table(arrow, file))


def results_document(study: "Study", command: str) -> dict[str, Any]:
    """Settings and results, as a dictionary that JSON can hold."""
    groups = study.groups()
    return {
        "command": command,
        "experiment": study.experiment.to_json(),
        "reachable": {
            group.config.problem.name: group.reachable
            for group in groups
            if group.bounds is not None
        },
        "results": [group_entries(group) for group in groups],
        "commit": source_commit(),
        "versions": package_versions(),
    }


def results_page(study: "Study", document: dict[str, Any], figures: dict[str, "Figure"]) -> str:
    """``RESULTS.md``: the table of results, the figures, and where settings come from.

    Parameters
    ----------
    study : Study
        The study.
    document : dict
        The `results_document`.
    figures : dict
        The figures by the names of their files.
    """
    trials = study.experiment.trials
    sources = [
        (each.title or each.name, each.source) for each in study.experiment.entries if each.source
    ]
    versions = ", ".join(f"{name} {number}" for name, number in document["versions"].items())
    return "\n".join(
        [
            f"# {study.experiment.name}\n",
            f"Made by `{document['command']}` at commit {document['commit'] or 'unknown'}. All "
            f"policies faced the same {trials.count} trials a problem, seed {trials.seed}. "
            "Intervals are 95 %, over seeds and trials; minutes are processor time without the "
            "trials.\n",
            markdown_table(headings(), [group_row(group) for group in study.groups()]),
            *(f"![{TITLES[name]}]({name}.png)\n" for name in figures),
            *(
                [markdown_table(("trainings", "source"), sources)]
                if any(s for _, s in sources)
                else ()
            ),
            versions + ".\n",
        ]
    )


def study_page(study: "Study", figures: dict[str, "Figure"], command: str = "") -> str:
    """One HTML page that fetches nothing; equal input gives equal text.

    Parameters
    ----------
    study : Study
        The study.
    figures : dict
        The figures by name.
    command : str
        The command that made it.
    """
    environment = template_environment(__package__, autoescape=True)
    environment.filters.update(percent=lambda share: f"{100 * share:.1f} %")
    groups = sorted(study.groups(), key=lambda group: -group.relative_success)
    best: dict[str, Group] = {}
    for group in groups:
        best.setdefault(group.config.problem.name, group)
    explained = [(name, METRICS[name].heading, METRICS[name].meaning) for name in FIGURES]
    return environment.get_template("experiment.html").render(
        experiment=study.experiment,
        subtitle=_subtitle(study),
        best=best.items(),
        headings=headings(),
        rows=[group_row(group) for group in groups],
        figures=[(name, TITLES[name], _svg(figure)) for name, figure in figures.items()],
        captions=CAPTIONS,
        failures=[(run.name, error) for run, error in study.failures.items()],
        command=command,
        text=tomli_w.dumps(study.experiment.to_json()),
        meanings=[(heading or name, meaning) for name, heading, meaning in explained],
        versions=package_versions(),
    )


def _subtitle(study: "Study") -> str:
    """A line about the finished share of the study, and about its trials."""
    trials = study.experiment.trials
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
