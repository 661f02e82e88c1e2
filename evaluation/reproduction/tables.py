"""Tables of a reproduction, in Markdown."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.markdown import markdown_table
from kinarm.evaluation.reproduction.claims import LEARNING_LEVELS, Claim, steps_to_levels
from kinarm.evaluation.reproduction.results import Results
from kinarm.evaluation.reproduction.runs import TrainedRun
from kinarm.evaluation.reproduction.study import LEARNERS, LITERAL, NEAR, Reading
from kinarm.evaluation.statistics import estimate_text
from kinarm.problem import PROBLEMS

MARKS = {"holds": "holds", "does not hold": "no", "undecided": "?", "not judged": ""}


def claims_table(claims: Iterable[Claim]) -> str:
    """Claims with what was measured; one row per part of a claim."""
    rows = [
        (
            claim.statement if part is claim.parts[0] else "",
            part.measure,
            estimate_text(part.estimate),
            f"{part.claimed} {part.threshold:g}",
            f"**{claim.verdict}**" if part is claim.parts[0] else "",
        )
        for claim in claims
        for part in claim.parts
    ]
    return markdown_table(("claim", "measure", "measured (95 %)", "claimed", "verdict"), rows)


def learners_table(results: Results) -> str:
    """Final policies of every learner next to what could be reached; means over seeds."""
    rows: list[list[str]] = []
    for number, task in enumerate(PROBLEMS, start=1):
        trials, name = results.trial_set(task), f"{number}: {task}"
        bounds = oracle_bounds(trials)
        final, possible = bounds.final_distance, float(bounds.reachable.mean())
        for purpose, label in LEARNERS.items():
            if runs := results.select(purpose, task):
                cells = _learner_cells(runs, trials.simulator.task.tolerance, possible)
                rows.append([name, f"{label}, {len(runs)} seeds", *cells])
        oracle = (f"{100 * possible:.1f}", "100.0", f"{100 * np.mean(final <= NEAR):.1f}")
        distances = (f"{np.median(final):.3f}", f"{final.mean():.3f}")
        rows.append([name, "oracle", *oracle, *distances, "0.0", ""])
    header = (
        *("task", "learner", "success %", "relative success %", f"within {NEAR} m % (seeds)"),
        *("median distance m", "mean distance m", "collision %", "million steps"),
    )
    return markdown_table(header, rows)


def _learner_cells(runs: Sequence[TrainedRun], tolerance: float, possible: float) -> list[str]:
    """How well the policies of a learner do."""
    distance = np.array([run.distance for run in runs])
    success = float((distance <= tolerance).mean())
    contact = np.mean([run.collision.mean() for run in runs])
    of_oracle = f"{100 * success / possible:.1f}" if possible else ""
    distances = (f"{np.median(distance):.3f}", f"{distance.mean():.3f}")
    shares = (f"{100 * success:.1f}", of_oracle, _near_cell(distance))
    return [*shares, *distances, f"{100 * contact:.1f}", _steps_cell(runs)]


def _near_cell(distance: NDArray[np.float64]) -> str:
    """Share of trials that ended near the goal, and its range over seeds [%]."""
    near = 100 * (distance <= NEAR).mean(axis=1)
    return f"{near.mean():.1f} ({near.min():.1f}..{near.max():.1f})"


def _steps_cell(runs: Sequence[TrainedRun]) -> str:
    """Mean number of environment steps of a training [millions]."""
    return f"{np.mean([run.environment_steps[-1] for run in runs]) / 1e6:.2f}"


def sweep_table(results: Results) -> str:
    """The nine settings that the paper tried first."""
    rows = []
    for (rate, perturbations), runs in results.sweep().items():
        distance = np.array([run.distance for run in runs])
        means = distance.mean(axis=1)
        mean = f"{means.mean():.3f} ({means.min():.3f}..{means.max():.3f})"
        near, steps = _near_cell(distance), _steps_cell(runs)
        rows.append((f"{rate:g}", str(perturbations), mean, near, steps))
    header = ("learning rate", "perturbations", "mean final distance m (seeds)")
    return markdown_table((*header, f"<= {NEAR} m % (seeds)", "million steps"), rows)


def speed_table(results: Results) -> str:
    """Environment steps after which levels of success were first seen; medians over seeds."""
    shown = [purpose for purpose in LEARNERS if results.select(purpose)]
    rows = []
    for task in PROBLEMS:
        steps = [steps_to_levels(results.select(purpose, task)) for purpose in shown]
        for number, (distance, share) in enumerate(LEARNING_LEVELS):
            cells = (_median_cell(learner[number]) for learner in steps)
            rows.append((task, f"{share:.0%} within {distance:g} m", *cells))
    header = ("task", "level", *(f"{LEARNERS[purpose]}, steps" for purpose in shown))
    return markdown_table(header, rows)


def _median_cell(steps: NDArray[np.float64]) -> str:
    """Median over seeds, and how many got there at all."""
    reached = int(np.isfinite(steps).sum())
    if not reached:
        return "never"
    median = float(np.median(steps))
    middle = f"{median / 1e3:.0f} thousand" if np.isfinite(median) else "most never"
    return middle if reached == len(steps) else f"{middle} ({reached} of {len(steps)} seeds)"


def readings_table(results: Results, claims: Mapping[Reading, Sequence[Claim]]) -> str:
    """Which claims hold under which reading, and how well ARS does there."""
    names = [claim.name for claim in claims[LITERAL] if not claim.name.startswith("sweep")]
    rows = []
    for reading, judged in claims.items():
        marks = {claim.name: MARKS[claim.verdict] for claim in judged}
        near = (np.mean(results.distances("ars", task, reading) <= NEAR) for task in PROBLEMS)
        shares = " / ".join(f"{100 * share:.0f}" for share in near)
        held = str(list(marks.values()).count("holds"))
        found = (*(marks.get(name, "") for name in names), held)
        rows.append((f"{reading.start_spread:g}", reading.reward, reading.sharing, shares, *found))
    header = ("starts", "reward", "shared by", f"ARS <= {NEAR} m %, left / right / both")
    return markdown_table((*header, *(f"`{name}`" for name in names), "hold"), rows)


def best_readings(claims: Mapping[Reading, Sequence[Claim]]) -> str:
    """Say under which readings most claims about policies hold."""
    held = {
        reading: [c.name for c in judged if c.verdict == "holds" and not c.name.startswith("sweep")]
        for reading, judged in claims.items()
    }
    if any(claim.verdict == "not judged" for judged in claims.values() for claim in judged):
        return "No claim is judged."
    most = max(len(names) for names in held.values())
    if not most:
        return "Under no reading does any of these claims hold."
    best = [
        f"starts {reading.start_spread:g}, reward {reading.reward}, shared by {reading.sharing} "
        f"({', '.join(f'`{name}`' for name in names)})"
        for reading, names in held.items()
        if len(names) == most
    ]
    return f"Most of these claims hold, {most}, under: {'; '.join(best)}."
