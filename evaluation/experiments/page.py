"""Everything that is written of an experiment: tables, figures and a page."""

import csv
import io
import json
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomli_w
from numpy.typing import NDArray

from kinarm._files import write_atomically, write_text
from kinarm.evaluation.experiments import table
from kinarm.evaluation.experiments.figures import draw_all
from kinarm.evaluation.figures import save_figure
from kinarm.evaluation.metrics import METRICS
from kinarm.evaluation.report.templating import markdown_table, template_environment
from kinarm.policies.provenance import package_versions, source_commit

if TYPE_CHECKING:
    from kinarm.evaluation.experiments.study import Study

TITLES = {
    "learning_curves": "Learning curves",
    "effects": "Effects",
    "beside_bound": "Beside the bound",
}


def write_all(study: "Study", command: str = "") -> Path:
    """Write what a study came to, and return the page.

    The files are ``index.html``, ``RESULTS.md``, ``results.json``, ``runs.csv``, ``curves.csv``,
    ``runs.parquet`` if pyarrow is there, and the figures; ``command`` made them, for the record.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    folder = study.store.folder
    write_csv(folder / "runs.csv", study.rows())
    write_csv(folder / "curves.csv", table.curve_rows(study))
    if find_spec("pyarrow") is not None:
        _write_parquet(folder / "runs.parquet", study.table())
    drawings = {}
    for name, figure in draw_all(study).items():
        _, drawn = save_figure(figure, folder, name)
        drawings[name] = drawn.read_text()
    document = results_document(study, command)
    write_text(folder / "results.json", json.dumps(document, indent=1) + "\n")
    write_text(folder / "RESULTS.md", _page("results.md", study, document, drawings))
    page = folder / "index.html"
    write_text(page, _page("experiment.html", study, document, drawings))
    return page


def write_csv(path: Path, rows: list[dict[str, Any]]) -> None:
    """Write one line per row."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]) if rows else ["key"], lineterminator="\n")
    writer.writeheader()
    for row in rows:
        lists = [name for name, each in row.items() if isinstance(each, list | tuple)]
        writer.writerow({**row, **{name: table.shown(row[name]) for name in lists}})
    write_text(path, text.getvalue())


def _write_parquet(path: Path, rows: NDArray[Any]) -> None:
    import pyarrow
    import pyarrow.parquet

    arrow = pyarrow.table({name: rows[name] for name in rows.dtype.names or ()})
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
        "results": [table.group_entries(group) for group in groups],
        "commit": source_commit(),
        "versions": package_versions(),
    }


def _page(name: str, study: "Study", document: dict[str, Any], drawings: Mapping[str, str]) -> str:
    """A page that fetches nothing; equal input gives equal text.

    Parameters
    ----------
    name : str
        Name of its template.
    study, document : Study and dict
        The study, and its settings and results.
    drawings : mapping of str to str
        Figures as SVG, by name.
    """
    environment = template_environment(autoescape=name.endswith(".html"))
    experiment, groups = study.experiment, study.best(len(study))
    best: dict[str, table.Group] = {}
    for group in groups:
        best.setdefault(group.config.problem.name, group)
    return environment.get_template(name).render(
        document,
        study=study,
        experiment=experiment,
        trials=experiment.trials,
        best=best.items(),
        headings=[heading for heading, _ in table.COLUMNS],
        rows=[table.group_row(group) for group in groups],
        rows_in_order=[table.group_row(group) for group in study.groups()],
        figures=[(name, TITLES[name], d[d.index("<svg") :]) for name, d in drawings.items()],
        failures=[(run.name, error) for run, error in study.failures.items()],
        sources=[
            (each.title or each.name, each.source) for each in experiment.entries if each.source
        ],
        text=tomli_w.dumps(experiment.to_json()),
        meanings=[(METRICS[name].heading or name, METRICS[name].meaning) for name in table.FIGURES],
        markdown_table=markdown_table,
    )
