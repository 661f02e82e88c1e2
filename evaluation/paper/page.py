"""The page of the reproduction, and ``claims.json``, tables, figures and policies beside it."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm._fields import to_plain
from kinarm._files import check_folder, write_text
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.experiments.study import Study
from kinarm.evaluation.figures import save_figure
from kinarm.evaluation.paper.claims import LEARNING_LEVELS, Claim, assess, steps_to_levels
from kinarm.evaluation.paper.figures import figure_2, figure_3, learning_curves
from kinarm.evaluation.paper.results import (
    LEARNERS,
    LITERAL,
    NEAR,
    PaperResults,
    Reading,
    final_distances,
)
from kinarm.evaluation.report.templating import markdown_table, template_environment
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

MARKS = {"holds": "holds", "does not hold": "no", "undecided": "?", "not judged": ""}
"""Verdicts in the table of readings."""


def write_all(study: Study, command: str) -> Sequence[Claim]:
    """Write all files of the finished reproduction, and return the claims read literally.

    The command that made it is recorded.
    """
    results, folder = PaperResults.of(study), study.store.folder
    claims = {reading: assess(results, reading) for reading in results.readings}
    document = _claims_document(results, claims, command, _save_policies(study, results))
    write_text(folder / "claims.json", json.dumps(document, indent=1) + "\n")
    write_text(folder / "runs.csv", runs_csv(results))
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
    """All verdicts and what they stand on, as ``claims.json`` holds them."""
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
    environment = template_environment(keep_trailing_newline=True)
    environment.filters.update(
        percent=lambda share, of=1.0: f"{100 * share / of:.1f}" if of else "",
        within=lambda distance: _mean_and_range(100 * (distance <= NEAR).mean(axis=1), 1),
        mean_and_range=_mean_and_range,
        million_steps=lambda runs: f"{np.mean([r.environment_steps for r in runs]) / 1e6:.2f}",
        median_cell=median_cell,
    )
    return environment.get_template("reproduction.md").render(
        results=results,
        document=document,
        smoke=SMOKE.format(len(results.runs)),
        claim_columns=CLAIM_COLUMNS,
        claims=claim_rows(claims[LITERAL]),
        tasks=PROBLEMS,
        learners=LEARNERS,
        shown=[purpose for purpose in LEARNERS if results.select(purpose)],
        levels=LEARNING_LEVELS,
        near=NEAR,
        readings=readings_table(results, claims),
        oracle_bounds=oracle_bounds,
        final_distances=final_distances,
        steps_to_levels=steps_to_levels,
        contact=lambda runs: np.mean([run.trained.outcomes.collision.mean() for run in runs]),
        median=np.median,
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


def _mean_and_range(values: NDArray[np.float64], digits: int) -> str:
    """Mean over seeds, and the range."""
    mean, low, high = (f"{each:.{digits}f}" for each in (values.mean(), values.min(), values.max()))
    return f"{mean} ({low}..{high})"


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
