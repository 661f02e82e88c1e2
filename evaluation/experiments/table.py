"""The tables of what an experiment came to: a row for each group of seeds, or point of a curve."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from kinarm.evaluation.experiments.results import Group, Results, identity, timed_curve
from kinarm.evaluation.metrics import METRICS
from kinarm.evaluation.statistics import share_over_seeds, wilson_interval

LEVELS = (0.5, 0.8)
"""Shares of success by which the speed of learning is told."""


class Column(NamedTuple):
    """A column of the table of groups, on the page and wherever it is printed.

    Attributes
    ----------
    heading : str
        What it is called.
    text : callable
        What it says of a group.
    """

    heading: str
    text: Callable[[Group], str]


def _figure(name: str) -> Callable[[Group], str]:
    """A figure of merit as text; nothing for an unknown one."""
    return lambda group: (
        "" if np.isnan(value := group.figures[name]) else METRICS[name].write(value)
    )


def _interval(group: Group) -> str:
    low, high = group.success.ci95 or (np.nan, np.nan)
    return METRICS["success"].write_range(low, high).replace("..", "\N{EN DASH}")


def _until(level: float) -> Callable[[Group], str]:
    """Environment steps [thousands] and processor time [min] until a share of trials succeeds."""

    def text(group: Group) -> str:
        steps, _, seconds = group.until(level)
        if math.isinf(steps):
            return "never"
        time = "" if math.isnan(seconds) else f", {seconds / 60:.2f}"
        return f"{steps / 1e3:,.0f}{time}"

    return text


COLUMNS = (
    Column("trainings", lambda group: group.label),
    Column("seeds", lambda group: str(len(group.runs))),
    Column("success %", _figure("success")),
    Column("95 %", _interval),
    Column(
        "worst seed %", lambda group: METRICS["success"].write(float(group.hits.mean(axis=1).min()))
    ),
    Column("relative success %", _figure("relative_success")),
    Column("collision %", _figure("collision")),
    Column("median distance m", _figure("median_distance")),
    Column("median steps", _figure("median_steps")),
    Column("step ratio", _figure("step_ratio")),
    Column("million steps", lambda group: f"{group.environment_steps / 1e6:.2f}"),
    Column("minutes", lambda group: f"{group.processor_seconds / 60:.2f}"),
    *(Column(f"thousand steps, minutes to {level:.0%}", _until(level)) for level in LEVELS),
)
"""What tables say of a group; minutes are processor time without the trials of the policies."""


def headings() -> tuple[str, ...]:
    """Of the table of groups."""
    return tuple(column.heading for column in COLUMNS)


def group_row(group: Group) -> tuple[str, ...]:
    """What the table says of a group."""
    return tuple(column.text(group) for column in COLUMNS)


def curve_rows(results: Results) -> list[dict[str, Any]]:
    """One row per point of a learning curve, the ends included."""
    fields = results.varied
    return [
        {
            "entry": run.entry.name,
            **identity(run),
            **{field: run.choices.get(field) for field in fields},
            **point._asdict(),
            "seconds": seconds,
            "processor_seconds": processor_seconds,
        }
        for run, trained in results.finished.items()
        for point, seconds, processor_seconds in timed_curve(trained, results.store.clock(run))
    ]


def group_entries(group: Group) -> dict[str, Any]:
    """What is known of a group, as a dictionary that JSON can hold.

    ``ci95`` is over seeds and trials, ``ci95_of_trials`` over trials that the seeds share.
    """
    n_trials = group.hits.shape[1]
    touched = np.array([run.outcomes.collision for run in group.runs])
    quantities = ("environment_steps", "seconds", "processor_seconds")
    return {
        "trainings": group.label,
        "entry": group.entry.name,
        "problem": group.config.problem.name,
        "choices": dict(group.choices),
        "seeds": len(group.runs),
        **{
            name: {
                **share_over_seeds(hits).to_json(),
                "ci95_of_trials": list(wilson_interval(int(hits.sum()), n_trials, len(hits))),
            }
            for name, hits in (("success", group.hits), ("collision", touched))
        },
        "success_each": group.hits.mean(axis=1).tolist(),
        "median_distance": float(np.mean([run.last.median_distance for run in group.runs])),
        "steps_to_success": group.steps_to_success,
        "environment_steps": group.environment_steps,
        "seconds": float(np.mean([clock.seconds for clock in group.clocks])),
        "processor_seconds": group.processor_seconds,
        "until": [
            {
                "success": level,
                **{
                    name: value if math.isfinite(value) else None
                    for name, value in zip(quantities, group.until(level), strict=True)
                },
            }
            for level in LEVELS
        ],
    }
