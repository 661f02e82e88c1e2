"""The page of the reproduction, and ``claims.json``, tables, figures and policies beside it."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm._fields import to_plain
from kinarm._files import check_folder, write_text
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.experiments.study import Study
from kinarm.evaluation.figures import save_figure
from kinarm.evaluation.markdown import markdown_table
from kinarm.evaluation.paper.claims import LEARNING_LEVELS, Claim, assess, steps_to_levels
from kinarm.evaluation.paper.figures import figure_2, figure_3, learning_curves
from kinarm.evaluation.paper.results import (
    LEARNERS,
    LITERAL,
    NEAR,
    PaperResults,
    PaperRun,
    Reading,
    final_distances,
)
from kinarm.evaluation.statistics import estimate_text
from kinarm.policies.provenance import package_versions
from kinarm.problem import PROBLEMS

Claims = Mapping[Reading, Sequence[Claim]]

FIGURES: Mapping[str, Callable[[PaperResults], Any]] = {
    "figure2": figure_2,
    "figure3": figure_3,
    "learning_curves": partial(learning_curves, against="steps"),
    "timing_learning_curves": partial(learning_curves, against="time"),
}
"""Figures by file name; what depends on the clock starts with ``timing``."""

SMOKE = (
    "A smoke run: each of {} trainings took a few iterations, to see that everything works. Its "
    "figures mean nothing, and no claim is judged."
)
"""A warning about trainings that judge no claim."""

RUN_COLUMNS = (
    *("training", "purpose", "task", "seed", "reading", "environment_steps"),
    *("within_0.05", "within_0.1", "within_0.2", "mean_distance", "median_distance", "contact"),
)

CLAIM_COLUMNS = ("claim", "measure", "measured (95 %)", "claimed", "verdict")

LEARNER_COLUMNS = (
    *("task", "learner", "success %", "relative success %", f"within {NEAR} m % (seeds)"),
    *("median distance m", "mean distance m", "collision %", "million steps"),
)

MARKS = {"holds": "holds", "does not hold": "no", "undecided": "?", "not judged": ""}
"""How verdicts are told in the table of readings."""


def write_all(study: Study, command: str) -> Sequence[Claim]:
    """Write all files of the finished reproduction beside its trainings.

    Parameters
    ----------
    study : Study
        The reproduction, of which nothing is missing.
    command : str
        The command that made it, for the record.

    Returns
    -------
    sequence of Claim
        The claims under the literal reading.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    results, folder = PaperResults.of(study), study.store.folder
    claims = {reading: assess(results, reading) for reading in results.readings}
    document = _claims_document(results, claims, command, _save_policies(study, results))
    write_text(folder / "claims.json", json.dumps(document, indent=1) + "\n")
    write_text(folder / "runs.csv", runs_csv(results))
    write_text(folder / "timing.json", json.dumps(timing(results), indent=1) + "\n")
    for name, draw in FIGURES.items():
        save_figure(draw(results), folder, name)
    write_text(folder / "REPRODUCTION.md", _page(results, claims, document))
    return claims[LITERAL]


def _save_policies(study: Study, results: PaperResults) -> list[str]:
    """Write every policy to a file of its own, and return the commits that they were made at."""
    folder, commits = study.store.folder / "policies", set()
    check_folder(folder)
    for run in results.runs:
        policy = study.policy(run.planned)
        policy.save(folder / f"{run.name}.npz")
        commits.add(policy.provenance.commit)
    return sorted(commits - {""})


def _claims_document(
    results: PaperResults, claims: Claims, command: str, commits: list[str]
) -> dict[str, Any]:
    """All verdicts and what they stand on, as a dictionary that JSON can hold."""
    trials = to_plain(results.experiment.trials)
    curve = trials["curve"]
    return {
        "study": "full" if results.is_judged else "quick",
        "command": command,
        "protocol": {
            "trials": trials["count"],
            "seed": trials["seed"],
            "snapshots": curve["points"],
            "snapshot_trials": curve["count"],
            "snapshot_seed": curve["seed"],
        },
        "trainings": len(results.runs),
        "environment_steps": sum(run.environment_steps for run in results.runs),
        "commits": commits,
        "versions": package_versions(),
        "readings": [
            {**asdict(reading), "name": reading.name, "claims": [c.to_json() for c in judged]}
            for reading, judged in claims.items()
        ],
    }


def _page(results: PaperResults, claims: Claims, document: Mapping[str, Any]) -> str:
    """``REPRODUCTION.md``."""
    rows = [
        (*row, f"**{verdict}**" if verdict else "") for *row, verdict in claim_rows(claims[LITERAL])
    ]
    page = files(__package__).joinpath("page.md").read_text(encoding="utf-8")
    return Template(page).substitute(
        warning="" if results.is_judged else f"**{SMOKE.format(len(results.runs))}**\n\n",
        command=document["command"],
        commits=", ".join(document["commits"]) or "unknown",
        trainings=document["trainings"],
        steps=f"{document['environment_steps']:,}",
        **document["protocol"],
        claims=markdown_table(CLAIM_COLUMNS, rows),
        learners=markdown_table(LEARNER_COLUMNS, _learner_rows(results)),
        sweep=_sweep_table(results),
        speed=_speed_table(results),
        readings=readings_table(results, claims),
        best_readings=_best_readings(claims),
        versions=", ".join(f"{name} {version}" for name, version in document["versions"].items()),
    )


def runs_csv(results: PaperResults) -> str:
    """One line per training."""
    lines: list[tuple[str, ...]] = [RUN_COLUMNS]
    for run in results.runs:
        made = (run.purpose, run.task, run.planned.config.seed, run.reading.name)
        within = (float(np.mean(run.distance <= limit)) for limit in (0.05, 0.1, 0.2))
        distances = (f"{value:.4f}" for value in (run.distance.mean(), np.median(run.distance)))
        row = (run.name, *made, run.environment_steps, *within, *distances)
        lines.append((*map(str, row), str(float(run.trained.outcomes.collision.mean()))))
    return "".join(",".join(line) + "\n" for line in lines)


def timing(results: PaperResults) -> dict[str, Any]:
    """Time that the trainings took [s], by purpose."""
    seconds: dict[str, float] = {}
    for run in results.runs:
        spent = seconds.get(run.purpose, 0.0) + run.clock.seconds
        seconds[run.purpose] = round(spent, 1)
    return {"training_seconds": seconds}


def claim_rows(claims: Iterable[Claim]) -> list[tuple[str, ...]]:
    """Claims with what was measured; one row per part of a claim."""
    return [
        (
            claim.statement if part is claim.parts[0] else "",
            part.measure,
            estimate_text(part.estimate),
            f"{part.claimed} {part.threshold:g}",
            claim.verdict if part is claim.parts[0] else "",
        )
        for claim in claims
        for part in claim.parts
    ]


def _learner_rows(results: PaperResults) -> list[list[str]]:
    """Final policies of every learner next to what could be reached; means over seeds."""
    rows = []
    for number, task in enumerate(PROBLEMS, start=1):
        trials, name = results.trial_set(task), f"{number}: {task}"
        bounds = oracle_bounds(trials)
        final, possible = bounds.final_distance, float(bounds.reachable.mean())
        for purpose, label in LEARNERS.items():
            if runs := results.select(purpose, task):
                cells = _learner_cells(runs, trials.problem.task.tolerance, possible)
                rows.append([name, f"{label}, {len(runs)} seeds", *cells])
        oracle = (f"{100 * possible:.1f}", "100.0", f"{100 * np.mean(final <= NEAR):.1f}")
        distances = (f"{np.median(final):.3f}", f"{final.mean():.3f}")
        rows.append([name, "oracle", *oracle, *distances, "0.0", ""])
    return rows


def _learner_cells(runs: Sequence[PaperRun], tolerance: float, possible: float) -> list[str]:
    """How well the policies of a learner do."""
    distance = final_distances(runs)
    success = float((distance <= tolerance).mean())
    contact = np.mean([run.trained.outcomes.collision.mean() for run in runs])
    of_oracle = f"{100 * success / possible:.1f}" if possible else ""
    distances = (f"{np.median(distance):.3f}", f"{distance.mean():.3f}")
    shares = (f"{100 * success:.1f}", of_oracle, _near_cell(distance))
    return [*shares, *distances, f"{100 * contact:.1f}", _steps_cell(runs)]


def _near_cell(distance: NDArray[np.float64]) -> str:
    """Share of trials that ended near the goal, and its range over seeds [%]."""
    near = 100 * (distance <= NEAR).mean(axis=1)
    return f"{near.mean():.1f} ({near.min():.1f}..{near.max():.1f})"


def _steps_cell(runs: Sequence[PaperRun]) -> str:
    """Mean number of environment steps of a training [millions]."""
    return f"{np.mean([run.environment_steps for run in runs]) / 1e6:.2f}"


def _sweep_table(results: PaperResults) -> str:
    """The nine settings that the paper tried first."""
    rows = []
    for (rate, perturbations), runs in results.sweep().items():
        distance = final_distances(runs)
        means = distance.mean(axis=1)
        mean = f"{means.mean():.3f} ({means.min():.3f}..{means.max():.3f})"
        near, steps = _near_cell(distance), _steps_cell(runs)
        rows.append((f"{rate:g}", str(perturbations), mean, near, steps))
    header = ("learning rate", "perturbations", "mean final distance m (seeds)")
    return markdown_table((*header, f"<= {NEAR} m % (seeds)", "million steps"), rows)


def _speed_table(results: PaperResults) -> str:
    """Environment steps after which levels of success were first seen; medians over seeds."""
    shown = [purpose for purpose in LEARNERS if results.select(purpose)]
    rows = []
    for task in PROBLEMS:
        steps = [steps_to_levels(results.select(purpose, task)) for purpose in shown]
        for number, (distance, share) in enumerate(LEARNING_LEVELS):
            cells = (median_cell(learner[number]) for learner in steps)
            rows.append((task, f"{share:.0%} within {distance:g} m", *cells))
    header = ("task", "level", *(f"{LEARNERS[purpose]}, steps" for purpose in shown))
    return markdown_table(header, rows)


def median_cell(steps: NDArray[np.float64]) -> str:
    """Median over seeds, and how many got there at all."""
    reached = int(np.isfinite(steps).sum())
    if not reached:
        return "never"
    median = float(np.median(steps))
    middle = f"{median / 1e3:.0f} thousand" if np.isfinite(median) else "most never"
    return middle if reached == len(steps) else f"{middle} ({reached} of {len(steps)} seeds)"


def readings_table(results: PaperResults, claims: Claims) -> str:
    """Which claims hold under which reading, and how well ARS does there."""
    names = [claim.name for claim in claims[LITERAL] if not claim.name.startswith("sweep")]
    rows = []
    for reading, judged in claims.items():
        marks = {claim.name: MARKS[claim.verdict] for claim in judged}
        ars = (final_distances(results.select("ars", task, reading)) for task in PROBLEMS)
        shares = " / ".join(f"{100 * np.mean(distance <= NEAR):.0f}" for distance in ars)
        count = str(list(marks.values()).count("holds"))
        found = (*(marks.get(name, "") for name in names), count)
        rows.append((f"{reading.start_spread:g}", reading.reward, reading.sharing, shares, *found))
    header = ("starts", "reward", "shared by", f"ARS <= {NEAR} m %, left / right / both")
    return markdown_table((*header, *(f"`{name}`" for name in names), "hold"), rows)


def _best_readings(claims: Claims) -> str:
    """Say under which readings most claims about policies hold."""
    if any(claim.verdict == "not judged" for claim in claims[LITERAL]):
        return "No claim is judged."
    holding = {
        reading: [c.name for c in judged if c.verdict == "holds" and not c.name.startswith("sweep")]
        for reading, judged in claims.items()
    }
    most = max(map(len, holding.values()))
    if not most:
        return "Under no reading does any of these claims hold."
    best = [
        f"starts {reading.start_spread:g}, reward {reading.reward}, shared by {reading.sharing} "
        f"({', '.join(f'`{name}`' for name in names)})"
        for reading, names in holding.items()
        if len(names) == most
    ]
    return f"Most of these claims hold, {most}, under: {'; '.join(best)}."
