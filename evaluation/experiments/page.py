"""The files about an experiment: tables, a figure and a page."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import tomli_w

from kinarm._files import write_text
from kinarm._tables import csv_text
from kinarm.evaluation.experiments import table
from kinarm.evaluation.experiments.table import Group, shown
from kinarm.evaluation.figures import Band, panels_figure, save_figure
from kinarm.evaluation.report.templating import markdown_table, template
from kinarm.policies.provenance import package_versions, source_commit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from kinarm.evaluation.experiments.study import Study

CURVES = "learning_curves"
"""Name of the files of the figure."""

LINES = 8
"""Most groups that it shows of a problem, the best ones."""


def write_all(study: "Study", command: str = "") -> Path:
    """Write the results of a study, and return the page.

    The files are ``index.html``, ``RESULTS.md``, ``results.json``, ``runs.csv``, ``curves.csv`` and
    the figure; ``command`` is recorded. Raises OutputError if a file cannot be written.
    """
    folder = study.store.folder
    write_csv(folder / "runs.csv", study.rows())
    write_csv(folder / "curves.csv", study.curve_rows())
    curves = ""
    if figure := learning_curves(study):
        _, drawn = save_figure(figure, folder, CURVES)
        curves = drawn.read_text()
    document = results_document(study, command)
    write_text(folder / "results.json", json.dumps(document, indent=1) + "\n")
    write_text(folder / "RESULTS.md", _page("results.md", study, document, curves))
    page = folder / "index.html"
    write_text(page, _page("experiment.html", study, document, curves))
    return page


def write_csv(path: Path, rows: list[dict[str, Any]]) -> None:
    """Write one line per row."""
    texts = [
        {
            name: shown(each) if isinstance(each, list | tuple) else each
            for name, each in row.items()
        }
        for row in rows
    ]
    write_text(path, csv_text(texts))


def results_document(study: "Study", command: str) -> dict[str, Any]:
    """Settings and results as JSON holds them."""
    return {
        "command": command,
        "experiment": study.experiment.to_json(),
        "results": [table.group_entries(group) for group in study.groups()],
        "commit": source_commit(),
        "versions": package_versions(),
    }


def _page(name: str, study: "Study", document: dict[str, Any], curves: str) -> str:
    """A page that fetches nothing, by its template; equal input gives equal text."""
    entries, groups = study.experiment.entries, study.best(len(study))
    best: dict[str, Group] = {}
    for group in groups:
        best.setdefault(group.config.problem.name, group)
    return template(name).render(
        document,
        study=study,
        best=best.items(),
        columns=table.COLUMNS,
        groups=groups,
        rows=[[str(each.cell(group)) for each in table.COLUMNS] for group in study.groups()],
        sources=[(each.title or each.name, each.source) for each in entries if each.source],
        curves=curves[curves.index("<svg") :] if curves else "",
        text=tomli_w.dumps(study.experiment.to_json()),
        markdown_table=markdown_table,
    )


def learning_curves(study: "Study") -> "Figure | None":
    """Success during the training, against environment steps and wall time.

    A row per problem; lines are means over the seeds, bands their 95 % intervals, and dotted is
    what the oracle reaches. None without curves.
    """
    from matplotlib.ticker import NullFormatter

    problems: dict[str, list[Group]] = {}
    for group in sorted(study.groups(), key=lambda each: -(each.success.value or 0)):
        if any(run.curve for run in group.runs):
            problems.setdefault(group.config.problem.name, []).append(group)
    if not problems:
        return None
    size = 10.0, 1.2 + 3.2 * len(problems)
    figure, panels = panels_figure(size, len(problems), 2, sharey=True)
    numbers: dict[Any, int] = {}  # of lines that are alike in all rows
    for (problem, groups), row in zip(problems.items(), panels, strict=True):
        for group in groups[:LINES]:
            alike = group.entry.name, *group.choices.items()
            _draw_curves(row, group, numbers.setdefault(alike, len(numbers)))
        for axes in row:
            axes.axhline(groups[0].reachable, color="#444444", linestyle=":", lw=1)
            axes.set(ylim=(0, 1.02), title=problem, xscale="log")
            axes.xaxis.set_minor_formatter(NullFormatter())
        row[0].set_ylabel("share of trials with success")
        row[0].legend(frameon=False, fontsize=8, loc="upper left")
    panels[-1, 0].set_xlabel("environment steps")
    panels[-1, 1].set_xlabel("wall time of the training [s]")
    return figure


def _draw_curves(panels: "Sequence[Axes]", group: Group, number: int) -> None:
    """Draw the mean of the seeds and its interval, against steps and seconds."""
    seeds = [
        np.array([(point.environment_steps, seconds, point.success) for point, seconds, _ in curve])
        for curve in (run.timed_curve for run in group.runs)
    ]
    for column, axes in enumerate(panels):
        begun = [seed[~(seed[:, column] <= 0)] for seed in seeds]
        curves = [(seed[:, column], seed[:, 2]) for seed in begun if len(seed)]
        if curves := [(x, y) for x, y in curves if np.isfinite(x).all()]:
            Band.of(curves).draw(axes, group.label, number)
