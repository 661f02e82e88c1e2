"""Groups of finished trainings, and tables of them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm._tables import ALWAYS, Column
from kinarm.evaluation.experiments.experiment import Entry
from kinarm.evaluation.experiments.plan import Run
from kinarm.evaluation.experiments.runs import TrainedRun
from kinarm.evaluation.metrics import METRICS
from kinarm.evaluation.outcomes import Outcomes
from kinarm.evaluation.statistics import Estimate, share_difference, share_over_seeds
from kinarm.evaluation.table import SEEDS_PRIORITY, difference_cell, metric_column
from kinarm.policies.config import TrainingConfig
from kinarm.policies.oracle import OracleSolutions

FIGURES = (
    *("success", "relative_success", "collision", "median_distance", "median_steps", "step_ratio"),
)
"""Figures of merit in a row, as in `kinarm.evaluation.METRICS`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Group:
    """Finished trainings, at least one, that differ in the seed alone.

    Attributes
    ----------
    label : str
        What sets them apart from other groups.
    entry, config, choices : Entry, TrainingConfig and mapping
        What they belong to, settings of the first, and what varies, by field.
    runs : tuple of TrainedRun
        The trainings by seed.
    bounds : OracleSolutions or None
        What the oracle knows about their trials.
    first : Group, optional
        The first group of the same problem, with which this one is compared.
    """

    label: str
    entry: Entry
    config: TrainingConfig
    choices: Mapping[str, Any]
    runs: tuple[TrainedRun, ...]
    bounds: OracleSolutions | None
    first: "Group | None" = None

    @cached_property
    def hits(self) -> NDArray[np.bool_]:
        """Which trials succeeded, shape (n_seeds, n_trials)."""
        return np.array([run.outcomes.success for run in self.runs])

    @cached_property
    def success(self) -> Estimate:
        """Share of successful trials, and its 95 % interval over seeds and trials."""
        return share_over_seeds(self.hits)

    @cached_property
    def difference(self) -> Estimate:
        """Success less that of the first group, in the same trials; unknown of the first itself."""
        if self.first is None:
            return Estimate(None)
        return share_difference(self.hits, self.first.hits)

    @cached_property
    def reachable(self) -> float:
        """Share of trials that the oracle solves; 1 if unknown."""
        return 1.0 if self.bounds is None else float(self.bounds.reachable.mean())

    @cached_property
    def estimates(self) -> dict[str, Estimate]:
        """The figures of merit over all seeds; success has an interval."""
        outcomes = Outcomes(tuple(run.outcomes for run in self.runs), self.bounds)
        known = {name: Estimate(_known(value)) for name, value in figures_of(outcomes).items()}
        return {**known, "success": self.success}

    @property
    def worst_seed(self) -> float:
        """Success of the worst seed."""
        return float(self.hits.mean(axis=1).min())

    @property
    def environment_steps(self) -> float:
        """Steps of a training, mean over the seeds."""
        return float(np.mean([run.last.environment_steps for run in self.runs]))

    @property
    def processor_seconds(self) -> float:
        """Processor time of a training, mean over the seeds [s]; NaN if unknown."""
        return float(np.mean([run.clock.processor_seconds for run in self.runs]))

    def until(self, level: float) -> tuple[float, float, float]:
        """Effort until policies reach a level of success; medians over seeds.

        Returns
        -------
        tuple of float
            Environment steps, wall time and processor time [s]; infinity for
            never, NaN for unknown times.
        """
        needed = []
        for run in self.runs:
            reached = [each for each in run.timed_curve if each[0].success >= level]
            there = [(point.environment_steps, *times) for point, *times in reached]
            needed.append(there[0] if there else (math.inf,) * 3)
        steps, seconds, processor = np.median(np.array(needed, dtype=float), axis=0).tolist()
        return steps, seconds, processor


def figures_of(outcomes: Outcomes) -> dict[str, float]:
    """Figures of merit of some trainings; NaN for unknown ones."""
    found = {}
    for name in FIGURES:
        value = METRICS[name].formula(outcomes)
        found[name] = math.nan if value is None else float(value)
    return found


def identity(run: Run) -> dict[str, Any]:
    """Who was trained on what."""
    config = run.config
    return {
        "learner": run.learner,
        "recipe": config.recipe.removesuffix("*"),
        "problem": config.problem.name,
        "seed": config.seed,
    }


def shown(value: Any) -> str:
    """A value in a label or a table."""
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, list | tuple):
        return "-".join(map(shown, value)) or "none"
    return str(value)


LEVELS = (0.5, 0.8)
"""Shares of success that measure the speed of learning."""


def _until_column(level: float) -> Column[Group]:
    """Environment steps [thousands] and processor time [min] to a success level."""
    name = f"until_{100 * level:.0f}"

    def text(group: Group) -> str:
        steps, _, seconds = group.until(level)
        if math.isinf(steps):
            return "never"
        time = "" if math.isnan(seconds) else f", {seconds / 60:.2f}"
        return f"{steps / 1e3:,.0f}{time}"

    return Column(f"thousand steps, minutes to {level:.0%}", text, name, priority=1)


def _number_column(heading: str, name: str, per: float, priority: float) -> Column[Group]:
    """The column of a number of groups, by its name, which is shown per a unit."""
    digits = 1 if heading.endswith("%") else 2

    def text(group: Group) -> str:
        number = getattr(group, name) / per
        return "" if math.isnan(number) else f"{number:.{digits}f}"

    return Column(heading, text, name, priority=priority)


COLUMNS: tuple[Column[Group], ...] = (
    Column("trainings", attrgetter("label"), priority=ALWAYS, words=True),
    Column("seeds", lambda group: len(group.runs), priority=SEEDS_PRIORITY),
    *(metric_column(name, attrgetter("estimates")) for name in FIGURES[:1]),
    Column(
        "less first %",
        lambda group: difference_cell("success", group.difference),
        "difference",
        "success less that of the first trainings of the problem, in the same trials",
        priority=9.5,
    ),
    *(metric_column(name, attrgetter("estimates")) for name in FIGURES[1:]),
    _number_column("worst seed %", "worst_seed", 0.01, 10.5),
    _number_column("million steps", "environment_steps", 1e6, 9),
    _number_column("minutes", "processor_seconds", 60, 9),
    *map(_until_column, LEVELS),
)
"""Minutes are processor time without the trials of the policies."""


def group_entries(group: Group) -> dict[str, Any]:
    """A group as JSON holds it; intervals are over seeds and trials."""
    touched = np.array([run.outcomes.collision for run in group.runs])
    return {
        "trainings": group.label,
        "entry": group.entry.name,
        "problem": group.config.problem.name,
        "choices": dict(group.choices),
        "seeds": len(group.runs),
        "reachable": None if group.bounds is None else group.reachable,
        "success": group.success.to_json(),
        "difference": group.first
        and {"first": group.first.label, "success": group.difference.to_json()},
        **{name: group.estimates[name].value for name in FIGURES[1:]},
        "collision": share_over_seeds(touched).to_json(),
        "success_each": group.hits.mean(axis=1).tolist(),
        "environment_steps": group.environment_steps,
        "seconds": _known(float(np.mean([run.clock.seconds for run in group.runs]))),
        "processor_seconds": _known(group.processor_seconds),
        "until": [_until_entries(group, level) for level in LEVELS],
    }


def _until_entries(group: Group, level: float) -> dict[str, Any]:
    names = ("environment_steps", "seconds", "processor_seconds")
    return {"success": level, **dict(zip(names, map(_known, group.until(level)), strict=True))}


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
