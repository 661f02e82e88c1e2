"""Write what a reproduction came to: ``REPRODUCTION.md``, ``claims.json``, tables and figures."""

import csv
import io
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np

from kinarm.errors import InvalidInputError
from kinarm.evaluation.figures import save_figure
from kinarm.evaluation.reproduction.claims import Claim, assess
from kinarm.evaluation.reproduction.figures import figure_2, figure_3, learning_curves
from kinarm.evaluation.reproduction.outcome import OutcomeStore
from kinarm.evaluation.reproduction.results import Results
from kinarm.evaluation.reproduction.study import LITERAL, Reading
from kinarm.evaluation.reproduction.tables import (
    best_readings,
    claims_table,
    learners_table,
    readings_table,
    speed_table,
    sweep_table,
)
from kinarm.files import write_text
from kinarm.policies.provenance import package_versions

FIGURES: dict[str, Callable[[Results], Any]] = {
    "figure2": figure_2,
    "figure3": figure_3,
    "learning_curves": partial(learning_curves, against="steps"),
    "timing_learning_curves": partial(learning_curves, against="time"),
}
"""Figures by file name; what depends on the clock starts with ``timing``."""


def write_all(results: Results, store: OutcomeStore, command: str) -> tuple[Claim, ...]:
    """Write all files of a finished reproduction.

    Parameters
    ----------
    results : Results
        All outcomes.
    store : OutcomeStore
        Where they lie.
    command : str
        The command that made them, for the record.

    Returns
    -------
    tuple of Claim
        The claims under the literal reading.

    Raises
    ------
    InvalidInputError
        If a training is not finished.
    OutputError
        If a file cannot be written.
    """
    if results.missing:
        raise InvalidInputError(f"{len(results.missing)} trainings are not finished")
    readings = results.study.readings()
    claims = {reading: assess(results, reading) for reading in readings}
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
    results: Results, claims: dict[Reading, tuple[Claim, ...]], store: OutcomeStore, command: str
) -> dict[str, Any]:
    """All verdicts and what they stand on, as a dictionary that JSON can hold."""
    study = results.study
    return {
        "study": study.name,
        "command": command,
        "protocol": asdict(study.protocol),
        "trainings": len(study.trainings),
        "environment_steps": sum(int(o.environment_steps[-1]) for o in results.outcomes.values()),
        "commits": list(store.commits(study.trainings)),
        "versions": package_versions(),
        "readings": [
            {**asdict(reading), "name": reading.name, "claims": [c.to_json() for c in judged]}
            for reading, judged in claims.items()
        ],
    }


def runs_csv(results: Results) -> str:
    """One line per training."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(RUN_COLUMNS)
    for training, outcome in results.outcomes.items():
        shares = [float(np.mean(outcome.distance <= limit)) for limit in (0.05, 0.1, 0.2)]
        distance = [
            f"{value:.4f}" for value in (outcome.distance.mean(), np.median(outcome.distance))
        ]
        contact = float(outcome.collision.mean())
        config = training.config
        writer.writerow(
            [
                training.name,
                *(training.purpose, config.task, config.seed, training.reading.name),
                int(outcome.environment_steps[-1]),
                *shares,
                *distance,
                contact,
            ]
        )
    return text.getvalue()


RUN_COLUMNS = (
    *("training", "purpose", "task", "seed", "reading", "environment_steps"),
    *("within_0.05", "within_0.1", "within_0.2", "mean_distance", "median_distance", "contact"),
)


def timing(results: Results) -> dict[str, Any]:
    """Time that the trainings took [s], by purpose."""
    seconds: dict[str, float] = {}
    for training, outcome in results.outcomes.items():
        spent = seconds.get(training.purpose, 0.0) + float(outcome.wall_time[-1])
        seconds[training.purpose] = round(spent, 1)
    return {"training_seconds": seconds}


def reproduction_page(
    results: Results, claims: dict[Reading, tuple[Claim, ...]], document: dict[str, Any]
) -> str:
    """``REPRODUCTION.md``."""
    protocol, versions = results.study.protocol, document["versions"]
    made = ", ".join(f"{name} {version}" for name, version in versions.items())
    quick = [
        "**A smoke version: nothing was trained to the end, and no verdict means anything.**",
        "",
    ]
    sections: Sequence[str] = [
        "# What holds of the paper's claims",
        "",
        *(quick if results.study.name == "quick" else []),
        f"Made by `{document['command']}` at commit {', '.join(document['commits']) or 'unknown'}: "
        f"{document['trainings']} trainings, {document['environment_steps'] / 1e6:.0f} million "
        f"environment steps. Final policies faced the same {protocol.trials} trials of their task "
        f"(seed {protocol.seed}). Intervals are 95 %, over training seeds and trials.",
        "",
        "## Verdicts under the literal reading",
        "",
        claims_table(claims[LITERAL]),
        "A claim holds where the whole interval lies on the claimed side, does not hold where it "
        "lies on the other, and is undecided between.",
        "",
        "## Twelve models of ARS, and PPO",
        "",
        learners_table(results),
        "![Training rewards and final distances of ARS](figure2.png)",
        "",
        "*The paper's Figure 2: mean returns of four trainings a task and their mean (left), and "
        "final distances in the trials (right).*",
        "",
        "![Densities of the final distances of ARS and PPO](figure3.png)",
        "",
        "*The paper's Figure 3: densities of the final distances, thin for each seed, on a "
        "square-root scale, where single trials show as small bumps; grey, what the oracle "
        "reaches.*",
        "",
        "## Learning rate and number of perturbations",
        "",
        sweep_table(results),
        "## Environment steps to a level",
        "",
        speed_table(results),
        "![Learning curves](learning_curves.png)",
        "",
        f"*What {protocol.snapshot_trials} other trials say of the policies in the course of their "
        "training.*",
        "",
        "![Learning curves against time](timing_learning_curves.png)",
        "",
        "*The same against the time that a training took.*",
        "",
        "## Other readings of the paper",
        "",
        "The paper leaves open how starts are drawn (here: from which share of the joint ranges "
        "about the home pose), how the reward is scaled (metres of progress, or their sign) and "
        "which rollouts of an ARS iteration share a start and goal.",
        "",
        readings_table(results, claims),
        best_readings(claims),
        "",
        f"Versions: {made}.",
        "",
    ]
    return "\n".join(sections)
