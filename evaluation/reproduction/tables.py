"""Tables of a reproduction, in Markdown."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.reproduction.claims import LEVELS, Claim, steps_to_levels
from kinarm.evaluation.reproduction.results import Results
from kinarm.evaluation.reproduction.study import LEARNERS, LITERAL, WITHIN, Reading
from kinarm.task import TASKS

MARKS = {"holds": "holds", "does not hold": "no", "undecided": "?"}


def markdown(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Format a table.

    Parameters
    ----------
    header : sequence of str
        Column headings.
    rows : iterable of sequence of str
        Cells.
    """
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def claims_table(claims: Iterable[Claim]) -> str:
    """Claims with what was measured; one row per part of a claim."""
    rows = [
        (
            claim.statement if part is claim.parts[0] else "",
            part.measure,
            str(part.estimate),
            f"{part.claimed} {part.threshold:g}",
            f"**{claim.verdict}**" if part is claim.parts[0] else "",
        )
        for claim in claims
        for part in claim.parts
    ]
    return markdown(("claim", "measure", "measured (95 %)", "claimed", "verdict"), rows)


def learners_table(results: Results) -> str:
    """Final policies of every learner next to what could be reached; means over seeds."""
    rows = []
    for number, task in enumerate(TASKS, start=1):
        bounds = oracle_bounds(results.trials(task))
        possible = float(bounds.reachable.mean())
        for purpose, label in LEARNERS.items():
            outcomes = tuple(results.select(purpose, task).values())
            if not outcomes:
                continue
            distance = np.array([outcome.distance for outcome in outcomes])
            within = (distance <= WITHIN).mean(axis=1)
            success = (distance <= results.trials(task).simulator.task.tolerance).mean()
            contact = np.mean([outcome.collision.mean() for outcome in outcomes])
            steps = np.mean([outcome.environment_steps[-1] for outcome in outcomes])
            rows.append(
                (
                    f"{number}: {task}",
                    f"{label}, {len(outcomes)} seeds",
                    f"{100 * success:.1f}",
                    f"{100 * success / possible:.1f}" if possible else "",
                    f"{100 * within.mean():.1f} ({_range(100 * within)})",
                    f"{np.median(distance):.3f}",
                    f"{distance.mean():.3f}",
                    f"{100 * contact:.1f}",
                    f"{steps / 1e6:.2f}",
                )
            )
        final = bounds.final_distance
        rows.append(
            (
                f"{number}: {task}",
                "oracle",
                f"{100 * possible:.1f}",
                "100.0",
                f"{100 * np.mean(final <= WITHIN):.1f}",
                f"{np.median(final):.3f}",
                f"{final.mean():.3f}",
                "0.0",
                "",
            )
        )
    header = (
        *("task", "learner", "success %", "of oracle %", f"<= {WITHIN} m % (seeds)"),
        *("median m", "mean m", "contact %", "million steps"),
    )
    return markdown(header, rows)


def _range(values: NDArray[np.float64]) -> str:
    return f"{values.min():.1f}..{values.max():.1f}"


def sweep_table(results: Results) -> str:
    """The nine settings that the paper tried first."""
    rows = []
    for (rate, perturbations), runs in results.sweep().items():
        distance = np.array([run.distance for run in runs])
        means, within = distance.mean(axis=1), (distance <= WITHIN).mean(axis=1)
        steps = np.mean([run.environment_steps[-1] for run in runs])
        rows.append(
            (
                f"{rate:g}",
                str(perturbations),
                f"{means.mean():.3f} ({means.min():.3f}..{means.max():.3f})",
                f"{100 * within.mean():.1f} ({_range(100 * within)})",
                f"{steps / 1e6:.2f}",
            )
        )
    header = ("learning rate", "perturbations", "mean final distance m (seeds)")
    return markdown((*header, f"<= {WITHIN} m % (seeds)", "million steps"), rows)


def speed_table(results: Results) -> str:
    """Environment steps after which levels of success were first seen; medians over seeds."""
    rows = []
    for task in TASKS:
        steps = {
            label: steps_to_levels(results, purpose, task, LITERAL)
            for purpose, label in LEARNERS.items()
            if results.select(purpose, task)
        }
        for number, (distance, share) in enumerate(LEVELS):
            cells = (_steps(steps[label][number]) if label in steps else "" for label in steps)
            rows.append((task, f"{share:.0%} within {distance:g} m", *cells))
    shown = [label for purpose, label in LEARNERS.items() if results.select(purpose)]
    return markdown(("task", "level", *(f"{label}, steps" for label in shown)), rows)


def _steps(steps: NDArray[np.float64]) -> str:
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
        verdicts = {claim.name: MARKS[claim.verdict] for claim in judged}
        within = (np.mean(results.distances("ars", task, reading) <= WITHIN) for task in TASKS)
        rows.append(
            (
                *(f"{reading.start_spread:g}", reading.reward, reading.sharing),
                " / ".join(f"{100 * share:.0f}" for share in within),
                *(verdicts.get(name, "") for name in names),
                str(sum(verdict == "holds" for verdict in verdicts.values())),
            )
        )
    header = ("starts", "reward", "shared by", f"ARS <= {WITHIN} m %, left / right / both")
    return markdown((*header, *(f"`{name}`" for name in names), "hold"), rows)


def best_readings(claims: Mapping[Reading, Sequence[Claim]]) -> str:
    """Say under which readings most claims about policies hold."""
    held = {
        reading: [c.name for c in judged if c.verdict == "holds" and not c.name.startswith("sweep")]
        for reading, judged in claims.items()
    }
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
