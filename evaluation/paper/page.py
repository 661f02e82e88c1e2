"""The files of the reproduction: page, figures, claims, table and policies."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from kinarm._fields import to_plain
from kinarm._files import check_folder, write_text
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.experiments.page import write_csv
from kinarm.evaluation.experiments.study import Study
from kinarm.evaluation.figures import BIN_WIDTH, COLOURS, panels_figure, save_figure
from kinarm.evaluation.paper.claims import LEARNING_LEVELS, Claim, assess, steps_to_levels
from kinarm.evaluation.paper.results import (
    LEARNERS,
    LITERAL,
    NEAR,
    PaperResults,
    Reading,
    final_distances,
)
from kinarm.evaluation.report.templating import template
from kinarm.policies.provenance import package_versions
from kinarm.problem import PROBLEMS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Claims = Mapping[Reading, Sequence[Claim]]

STYLES: dict[str, dict[str, Any]] = {
    "ars": {"label": LEARNERS["ars"], "color": COLOURS[0], "linestyle": "solid"},
    "ppo": {"label": LEARNERS["ppo"], "color": COLOURS[1], "linestyle": "dashed"},
}
"""Lines of a learner; its seeds are thin and faint in the same colour."""

SHOWN_DISTANCE, NARROWEST = 1.2, 0.005
"""End of the axes of final distances, and least bandwidth of a density [m]."""

SMOKE = (
    "A smoke run: each of {} trainings took a few iterations, to see that everything works. Its "
    "figures mean nothing, and no claim is judged."
)
"""Warning about trainings that judge no claim."""

CLAIM_COLUMNS = ("claim", "measure", "measured (95 %)", "claimed", "verdict")


def write_all(study: Study, command: str) -> Sequence[Claim]:
    """Write all files of the reproduction, and return the claims read literally.

    The command is recorded.
    """
    results, folder = PaperResults.of(study), study.store.folder
    claims = {reading: assess(results, reading) for reading in results.readings}
    document = claims_document(results, claims, command, _save_policies(study, results))
    write_text(folder / "claims.json", json.dumps(document, indent=1) + "\n")
    write_csv(folder / "runs.csv", run_rows(results))
    figures = {
        "figure2": figure_2(results),
        "figure3": figure_3(results),
        "learning_curves": learning_curves(results, against="steps"),
        "timing_learning_curves": learning_curves(results, against="time"),
    }
    for name, figure in figures.items():
        save_figure(figure, folder, name)
    write_text(folder / "REPRODUCTION.md", reproduction_page(results, claims, document))
    return claims[LITERAL]


def _save_policies(study: Study, results: PaperResults) -> list[str]:
    """Write every policy to a file, and return their commits."""
    folder, commits = study.store.folder / "policies", set()
    check_folder(folder)
    for run in results.runs:
        policy = study.policy(run.planned)
        policy.save(folder / f"{run.name}.npz")
        commits.add(policy.provenance.commit)
    return sorted(commits - {""})


def claims_document(
    results: PaperResults, claims: Claims, command: str, commits: list[str]
) -> dict[str, Any]:
    """All verdicts and their evidence, as ``claims.json`` holds them."""
    return {
        "study": "full" if results.is_judged else "quick",
        "command": command,
        "protocol": to_plain(results.experiment.trials),
        "trainings": len(results.runs),
        "environment_steps": sum(run.environment_steps for run in results.runs),
        "commits": commits,
        "versions": package_versions(),
        "readings": [
            {**asdict(reading), "name": reading.name, "claims": [c.to_json() for c in judged]}
            for reading, judged in claims.items()
        ],
    }


def reproduction_page(results: PaperResults, claims: Claims, document: Mapping[str, Any]) -> str:
    """``REPRODUCTION.md``."""
    return template("reproduction.md").render(
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
        judged=claims,
        compared=[c.name for c in claims[LITERAL] if not c.name.startswith("sweep")],
        oracle_bounds=oracle_bounds,
        final_distances=final_distances,
        steps_to_levels=steps_to_levels,
        ended=lambda runs, how: np.mean([getattr(run.trained.outcomes, how) for run in runs]),
        median=np.median,
    )


def run_rows(results: PaperResults) -> list[dict[str, Any]]:
    """One row per training."""
    return [
        {
            "training": run.name,
            "purpose": run.purpose,
            "task": run.task,
            "seed": run.planned.config.seed,
            "reading": run.reading.name,
            "environment_steps": run.environment_steps,
            **{f"within_{d}": float(np.mean(run.distance <= d)) for d in (0.05, 0.1, 0.2)},
            "mean_distance": f"{run.distance.mean():.4f}",
            "median_distance": f"{np.median(run.distance):.4f}",
            "contact": float(run.trained.outcomes.collision.mean()),
        }
        for run in results.runs
    ]


def claim_rows(claims: Iterable[Claim]) -> list[tuple[str, ...]]:
    """One row per part of a claim."""
    return [
        (
            claim.statement if part is claim.parts[0] else "",
            part.measure,
            str(part.estimate),
            f"{part.claimed} {part.threshold:g}",
            claim.verdict if part is claim.parts[0] else "",
        )
        for claim in claims
        for part in claim.parts
    ]


def figure_2(results: PaperResults) -> "Figure":
    """Training rewards and final distances of ARS, a row per task (paper, Figure 2).

    Seeds are in colour, and the mean of their returns in black.
    """
    figure, panels = panels_figure((9.0, 8.4), len(PROBLEMS), 2, sharex="col", sharey="col")
    edges = np.arange(0.0, SHOWN_DISTANCE + BIN_WIDTH, BIN_WIDTH)
    for number, (task, (left, right)) in enumerate(zip(PROBLEMS, panels, strict=True), start=1):
        runs = results.select("ars", task)
        returns = np.array([run.trained.returns for run in runs])
        iterations = np.arange(1, returns.shape[1] + 1)
        for seed, run in enumerate(runs):
            left.plot(iterations, returns[seed], color=COLOURS[seed], lw=0.6, label=f"seed {seed}")
            shares = np.histogram(run.distance, edges)[0] / len(run.distance)
            label = f"seed {seed}: {np.mean(run.distance <= NEAR):.0%} within {NEAR} m"
            right.stairs(shares, edges, color=COLOURS[seed], lw=1.3, label=label)
        left.plot(iterations, returns.mean(axis=0), color="black", lw=1.6, label="mean")
        right.axvline(NEAR, color="#444444", linestyle=":", lw=1)
        right.legend(frameon=False, fontsize=8)
        left.set_ylabel(f"task {number}: {task}\nmean return of an iteration")
        right.set_ylabel(f"share of trials per {BIN_WIDTH} m")
    panels[0, 0].legend(frameon=False, loc="lower right")
    panels[-1, 0].set_xlabel("iteration")
    panels[-1, 1].set(xlabel="final distance to the goal [m]", xlim=(0, SHOWN_DISTANCE))
    return figure


def figure_3(results: PaperResults) -> "Figure":
    """Densities of the final distances of ARS and PPO, a row per task (paper, Figure 3).

    Behind them is the oracle's. Heights are square roots, which show broad and narrow densities
    side by side.
    """
    figure, panels = panels_figure((7.5, 8.4), len(PROBLEMS), 1, sharex=True)
    for number, (task, axes) in enumerate(zip(PROBLEMS, panels[:, 0], strict=True), start=1):
        distance = np.linspace(0.0, SHOWN_DISTANCE, 481)
        highest = 0.0
        for learner, style in STYLES.items():
            if runs := results.select(learner, task):
                seeds = np.array([density(run.distance, distance) for run in runs])
                _seeds_and_mean(axes, np.tile(distance, (len(runs), 1)), seeds, style, lw=2.2)
                highest = max(highest, float(seeds.max()))
        trials = results.trial_set(task)
        reached = oracle_bounds(trials).final_distance
        axes.fill_between(
            distance, density(reached, distance), color="#bbbbbb", lw=0, label="oracle (cut off)"
        )
        axes.axvline(trials.simulator.task.tolerance, color="#444444", linestyle=":", lw=1)
        axes.set_yscale("function", functions=(np.sqrt, np.square))
        axes.set(ylabel=f"task {number}: {task}\ndensity [1/m]", ylim=(0, 1.1 * highest))
    panels[0, 0].legend(frameon=False)
    panels[-1, 0].set(xlabel="final distance to the goal [m]", xlim=(0, SHOWN_DISTANCE))
    return figure


def density(samples: NDArray[np.float64], positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Kernel density of distances, reflected at zero so that none is lost below it.

    The kernel is normal, with Silverman's robust bandwidth, because a few trials that end far away
    must not blur the others. From samples, shape (n,), and positions, shape (m,) [m], to
    densities, shape (m,) [1/m], whose integral over positive distances is 1.
    """
    from scipy.stats import iqr, norm

    spread = min(float(samples.std()), float(iqr(samples)) / 1.349)
    bandwidth = max(0.9 * spread * len(samples) ** -0.2, NARROWEST)
    reflected = np.concatenate([samples, -samples])
    kernels = norm.pdf(positions[:, None], loc=reflected, scale=bandwidth)
    values: NDArray[np.float64] = kernels.sum(axis=1) / len(samples)
    return values


def learning_curves(results: PaperResults, against: Literal["steps", "time"]) -> "Figure":
    """How well policies do in the course of training, a column per task."""
    figure, panels = panels_figure((10.5, 6.4), 2, len(PROBLEMS), sharex=True, sharey="row")
    in_time = against == "time"
    for task, (above, below) in zip(PROBLEMS, panels.T, strict=True):
        for learner, style in STYLES.items():
            if runs := results.select(learner, task):
                times = [
                    run.trained.clock.points if in_time else run.curve_steps / 1e6 for run in runs
                ]
                x = np.array(times)
                distance = np.array([run.curve_distance for run in runs])
                _seeds_and_mean(above, x, (distance <= NEAR).mean(axis=2), style, lw=2)
                _seeds_and_mean(below, x, np.median(distance, axis=2), style, lw=2)
        above.set_title(f"task {task}")
        below.set_xlabel("training time [s]" if in_time else "million environment steps")
        below.set_xscale("log" if in_time else "linear")
    panels[0, 0].set(ylabel=f"share of trials within {NEAR} m", ylim=(0, 1))
    panels[1, 0].set(ylabel="median final distance [m]", ylim=(0, None))
    panels[0, 0].legend(frameon=False)
    return figure


def _seeds_and_mean(
    axes: "Axes", x: NDArray[np.float64], y: NDArray[np.float64], style: dict[str, Any], lw: float
) -> None:
    """Curves of the seeds faintly, and their mean boldly."""
    axes.plot(x.T, y.T, color=style["color"], lw=0.6, alpha=0.5)
    axes.plot(x.mean(axis=0), y.mean(axis=0), lw=lw, **style)
