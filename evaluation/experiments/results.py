"""What the trainings of an experiment came to: groups of seeds, and tables of them."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.experiments.curve import CurvePoint
from kinarm.evaluation.experiments.experiment import Entry, Experiment
from kinarm.evaluation.experiments.plan import Run
from kinarm.evaluation.experiments.runs import Clock, TrainedRun, TrialBounds, load_run
from kinarm.evaluation.experiments.store import Store
from kinarm.evaluation.experiments.train import BoundTask
from kinarm.evaluation.metrics import METRICS
from kinarm.evaluation.outcomes import Outcomes
from kinarm.evaluation.statistics import Estimate, share_over_seeds
from kinarm.policies.config import TrainingConfig
from kinarm.policies.policy import Policy

FIGURES = (
    *("success", "relative_success", "collision", "median_distance", "median_steps", "step_ratio"),
)
"""Figures of merit that a row tells of a training, as in `kinarm.evaluation.METRICS`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Group:
    """Finished trainings with the same settings but for the seed, at least one.

    Attributes
    ----------
    label : str
        What sets them apart from the other groups of the experiment.
    entry : Entry
        What they belong to.
    config : TrainingConfig
        Settings of the first of them.
    choices : mapping
        What of them varies in the experiment, by field.
    runs : tuple of TrainedRun
        The trainings by seed.
    clocks : tuple of Clock
        How long they took.
    bounds : TrialBounds or None
        What the oracle knows about their trials.
    """

    label: str
    entry: Entry
    config: TrainingConfig
    choices: Mapping[str, Any]
    runs: tuple[TrainedRun, ...]
    clocks: tuple[Clock, ...]
    bounds: TrialBounds | None

    @cached_property
    def hits(self) -> NDArray[np.bool_]:
        """Which trials succeeded, shape (n_seeds, n_trials)."""
        return np.array([run.outcomes.success for run in self.runs])

    @cached_property
    def success(self) -> Estimate:
        """Share of trials with success, and its 95 % interval over seeds and trials."""
        return share_over_seeds(self.hits)

    @cached_property
    def reachable(self) -> float:
        """Share of the trials in which the oracle reaches; 1 if that is not known."""
        return 1.0 if self.bounds is None else float(self.bounds.reachable.mean())

    @property
    def relative_success(self) -> float:
        """Success over what the oracle reaches."""
        return float(self.success.value or 0.0) / max(self.reachable, 1e-9)

    @cached_property
    def figures(self) -> dict[str, float]:
        """The figures of merit over all seeds; NaN for unknown ones."""
        return figures_of(Outcomes(tuple(run.outcomes for run in self.runs), self.bounds))

    @property
    def environment_steps(self) -> float:
        """Steps of a training, mean over the seeds."""
        return float(np.mean([run.last.environment_steps for run in self.runs]))

    @property
    def processor_seconds(self) -> float:
        """Time of all processors that a training took, mean over the seeds [s]."""
        return float(np.mean([clock.processor_seconds for clock in self.clocks]))

    @property
    def steps_to_success(self) -> float | None:
        """Median steps of trials with success, mean over the seeds; None if a seed has none."""
        each = [run.outcomes.steps[run.outcomes.success] for run in self.runs]
        if not all(steps.size for steps in each):
            return None
        return float(np.mean([np.median(steps) for steps in each]))

    def until(self, level: float) -> tuple[float, float, float]:
        """What it takes until policies first succeed in a share of trials; medians over seeds.

        Returns
        -------
        tuple of float
            Environment steps, wall time and processor time [s]; infinity for never, NaN where the
            times are not known.
        """
        needed = []
        for run, clock in zip(self.runs, self.clocks, strict=True):
            timed = timed_curve(run, clock)
            there = [(p.environment_steps, *times) for p, *times in timed if p.success >= level]
            needed.append(there[0] if there else (math.inf,) * 3)
        steps, seconds, processor = np.median(np.array(needed, dtype=float), axis=0).tolist()
        return steps, seconds, processor


def timed_curve(run: TrainedRun, clock: Clock) -> list[tuple[CurvePoint, float, float]]:
    """Points of a learning curve, the end included, with wall time and processor time [s].

    Parameters
    ----------
    run : TrainedRun
        The training.
    clock : Clock
        How long it took; times are NaN if it does not know.
    """
    points, unknown = run.curve, (math.nan,) * len(run.curve)
    columns = [
        times if len(times) == len(points) else unknown
        for times in (clock.points, clock.processor_points)
    ]
    timed = list(zip(points, *columns, strict=True))
    if not points or points[-1].iteration < run.last.iteration:
        known = (clock.seconds, clock.processor_seconds) if clock.seconds else (math.nan, math.nan)
        timed.append((run.last, *known))
    return timed


def figures_of(outcomes: Outcomes) -> dict[str, float]:
    """Figures of merit of some trainings; NaN for unknown ones."""
    found = {}
    for name in FIGURES:
        known = outcomes.bounds is not None or not METRICS[name].needs_bounds
        value = METRICS[name].formula(outcomes) if known else None
        found[name] = float("nan") if value is None else float(value)
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


def shorter(field: str) -> str:
    """The last name of a path."""
    return field.rpartition(".")[2]


def shown(value: Any) -> str:
    """A value in a label or a table."""
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, list | tuple):
        return "-".join(map(shown, value))
    return str(value)


def _column(values: Sequence[Any]) -> NDArray[Any]:
    """Values of one kind as an array: numbers if all of them are, else texts."""
    numbers = all(isinstance(each, bool | int | float) for each in values)
    return np.array(values if numbers else ["" if v is None else shown(v) for v in values])


class Results:
    """What the finished trainings of an experiment came to.

    Parameters
    ----------
    experiment : Experiment
        What is trained.
    store : Store
        The folder in which the trainings lie, or will.
    runs : tuple of Run
        The trainings, whether finished or not.
    """

    def __init__(self, experiment: Experiment, store: Store, runs: tuple[Run, ...]) -> None:
        self.experiment, self.store, self.runs = experiment, store, runs

    def __len__(self) -> int:
        return len(self.finished)

    def __iter__(self) -> Iterator[TrainedRun]:
        return iter(self.finished.values())

    @cached_property
    def finished(self) -> Mapping[Run, TrainedRun]:
        """The trainings that are finished, in the order of the experiment."""
        return self.store.load(self.runs)

    @property
    def missing(self) -> tuple[Run, ...]:
        """The trainings that are not finished."""
        return tuple(run for run in self.runs if run not in self.finished)

    @cached_property
    def bounds(self) -> Mapping[str, TrialBounds]:
        """What the oracle knows about the trials, as far as it is known, by the problem's hash."""
        found = {task.problem.digest: self.store.bounds(task) for task in self.bound_tasks}
        return {digest: bounds for digest, bounds in found.items() if bounds is not None}

    @property
    def bound_tasks(self) -> tuple[BoundTask, ...]:
        """The trials whose bounds belong to the experiment."""
        if not self.experiment.bounds:
            return ()
        problems = {run.config.problem.digest: run.config.problem for run in self.runs}
        return tuple(BoundTask(each, self.experiment.trials) for each in problems.values())

    @property
    def failures(self) -> Mapping[Run, str]:
        """Why trainings failed that were not finished since."""
        found = {run: self.store.failure(run) for run in self.missing}
        return {run: error for run, error in found.items() if error is not None}

    def policy(self, run: Run) -> Policy:
        """The policy of a finished training, with versions and commit that made it.

        Raises
        ------
        InvalidInputError
            If the training is not finished, or its file is damaged.
        """
        trained = load_run(self.store.run_path(run), run, whole=True)
        assert trained.policy is not None
        made = self.store.made(run)
        known = {name: made[name] for name in ("versions", "commit") if name in made}
        provenance = replace(trained.policy.provenance, **known)
        return replace(trained.policy, provenance=provenance)

    def groups(self) -> tuple[Group, ...]:
        """The finished trainings, those with the same settings but for the seed together."""
        return self._groups

    @cached_property
    def _groups(self) -> tuple[Group, ...]:
        shared: dict[tuple[str, str], list[Run]] = {}
        for run in self.finished:
            config = {k: v for k, v in run.settings["config"].items() if k != "seed"}
            shared.setdefault((run.entry.name, repr((run.learner, config))), []).append(run)
        return tuple(
            Group(
                label=self._label(runs[0]),
                entry=runs[0].entry,
                config=runs[0].config,
                choices=runs[0].choices,
                runs=tuple(self.finished[run] for run in runs),
                clocks=tuple(self.store.clock(run) for run in runs),
                bounds=self.bounds.get(runs[0].config.problem.digest),
            )
            for runs in shared.values()
        )

    def best(self, count: int = 1) -> tuple[Group, ...]:
        """The settings with the largest success over what the oracle reaches, best first."""
        ordered = sorted(self.groups(), key=lambda group: -group.relative_success)
        return tuple(ordered[:count])

    def _label(self, run: Run) -> str:
        """What to call the trainings with the settings of a run."""
        experiment, names = self.experiment, identity(run)
        if experiment.entries:
            parts = [run.entry.title or run.entry.name]
        else:
            several = {"learner": experiment.learners, "recipe": experiment.recipes}
            parts = [str(names[name]) for name, values in several.items() if len(values) > 1]
        if len({each.config.problem.name for each in self.runs}) > 1:
            parts.append(names["problem"])
        parts += [f"{shorter(field)}={shown(value)}" for field, value in run.choices.items()]
        return " ".join(parts) or f"{names['learner']} {names['recipe']} {names['problem']}"

    @property
    def varied(self) -> list[str]:
        """Fields that vary between the finished trainings."""
        return list(dict.fromkeys(field for run in self.finished for field in run.choices))

    def rows(self) -> list[dict[str, Any]]:
        """One row per finished training: learner, varied fields, figures of merit, times."""
        fields = self.varied
        rows = []
        for run, trained in self.finished.items():
            clock = self.store.clock(run)
            outcomes = Outcomes((trained.outcomes,), self.bounds.get(run.config.problem.digest))
            rows.append(
                {
                    **({"entry": run.entry.name} if self.experiment.entries else {}),
                    **identity(run),
                    **{field: run.choices.get(field) for field in fields},
                    "iterations": trained.last.iteration,
                    "environment_steps": trained.last.environment_steps,
                    "seconds": clock.seconds or math.nan,
                    "processor_seconds": clock.processor_seconds or math.nan,
                    **figures_of(outcomes),
                    "key": run.key,
                }
            )
        return rows

    def table(self) -> "np.ndarray[Any, np.dtype[Any]]":
        """The `rows` as a structured array; fields that are no numbers are texts."""
        rows = self.rows()
        columns = {name: _column([row[name] for row in rows]) for name in (rows[0] if rows else ())}
        table = np.empty(
            len(rows), dtype=[(name, column.dtype) for name, column in columns.items()]
        )
        for name, column in columns.items():
            table[name] = column
        return table
