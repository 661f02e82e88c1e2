"""Write what a reproduction came to: ``REPRODUCTION.md``, ``claims.json``, tables and figures."""

import json
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np

from kinarm._files import write_text
from kinarm.evaluation.figures import save_figure
from kinarm.evaluation.reproduction.claims import Claim, assess
from kinarm.evaluation.reproduction.figures import figure_2, figure_3, learning_curves
from kinarm.evaluation.reproduction.results import Results
from kinarm.evaluation.reproduction.runs import RunStore
from kinarm.evaluation.reproduction.study import LITERAL, Reading
from kinarm.evaluation.reproduction.tables import (
    best_readings,
    claims_table,
    learners_table,
    readings_table,
    speed_table,
    sweep_table,
)
from kinarm.policies.provenance import package_versions

FIGURES: dict[str, Callable[[Results], Any]] = {
    "figure2": figure_2,
    "figure3": figure_3,
    "learning_curves": partial(learning_curves, against="steps"),
    "timing_learning_curves": partial(learning_curves, against="time"),
}
"""Figures by file name; what depends on the clock starts with ``timing``."""


def write_all(results: Results, store: RunStore, command: str) -> tuple[Claim, ...]:
    """Write all files of a finished reproduction, and return the claims of the literal reading.

    The command that made them is for the record.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    claims = {reading: assess(results, reading) for reading in results.study.readings()}
    document = claims_document(results, claims, store, command)
    folder = store.folder
    write_text(folder / "claims.json", json.dumps(document, indent=1) + "\n")
    write_text(folder / "runs.csv", runs_csv(results))
    write_text(folder / "timing.json", json.dumps(timing(results), indent=1) + "\n")
    for name, draw in FIGURES.items():
        save_figure(draw(results), folder, name)
    write_text(folder / "REPRODUCTION.md", reproduction_page(results, claims, document))
    return claims[LITERAL]


def claims_document(
    results: Results, claims: dict[Reading, tuple[Claim, ...]], store: RunStore, command: str
) -> dict[str, Any]:
    """All verdicts and what they stand on, as a dictionary that JSON can hold."""
    study = results.study
    return {
        "study": study.name,
        "command": command,
        "protocol": asdict(study.protocol),
        "trainings": len(study.trainings),
        "environment_steps": sum(int(run.environment_steps[-1]) for run in results.runs.values()),
        "commits": list(store.commits(study.trainings)),
        "versions": package_versions(),
        "readings": [
            {**asdict(reading), "name": reading.name, "claims": [c.to_json() for c in judged]}
            for reading, judged in claims.items()
        ],
    }


def runs_csv(results: Results) -> str:
    """One line per training."""
    lines: list[tuple[str, ...]] = [RUN_COLUMNS]
    for training, run in results.runs.items():
        problem, distance = training.config.problem.name, run.distance
        made = (training.purpose, problem, training.config.seed, training.reading.name)
        within = (float(np.mean(distance <= limit)) for limit in (0.05, 0.1, 0.2))
        distances = (f"{value:.4f}" for value in (distance.mean(), np.median(distance)))
        row = (training.name, *made, int(run.environment_steps[-1]), *within, *distances)
        lines.append((*map(str, row), str(float(run.collision.mean()))))
    return "".join(",".join(line) + "\n" for line in lines)


RUN_COLUMNS = (
    *("training", "purpose", "task", "seed", "reading", "environment_steps"),
    *("within_0.05", "within_0.1", "within_0.2", "mean_distance", "median_distance", "contact"),
)


def timing(results: Results) -> dict[str, Any]:
    """Time that the trainings took [s], by purpose."""
    seconds: dict[str, float] = {}
    for training, run in results.runs.items():
        spent = seconds.get(training.purpose, 0.0) + float(run.wall_time[-1])
        seconds[training.purpose] = round(spent, 1)
    return {"training_seconds": seconds}


def reproduction_page(
    results: Results, claims: dict[Reading, tuple[Claim, ...]], document: dict[str, Any]
) -> str:
    """``REPRODUCTION.md``."""
    study, protocol = results.study, results.study.protocol
    page = files(__package__).joinpath("page.md").read_text(encoding="utf-8")
    return Template(page).substitute(
        warning=f"**{study.warning}**\n\n" if study.warning else "",
        command=document["command"],
        commits=", ".join(document["commits"]) or "unknown",
        trainings=document["trainings"],
        steps=f"{document['environment_steps']:,}",
        **asdict(protocol),
        claims=claims_table(claims[LITERAL]),
        learners=learners_table(results),
        sweep=sweep_table(results),
        speed=speed_table(results),
        readings=readings_table(results, claims),
        best_readings=best_readings(claims),
        versions=", ".join(f"{name} {version}" for name, version in document["versions"].items()),
    )
