"""What the trainings of an experiment came to: groups of seeds, and tables of them."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.experiments.curve import CurvePoint
from kinarm.evaluation.experiments.experiment import Entry
from kinarm.evaluation.experiments.plan import Run
from kinarm.evaluation.experiments.runs import Clock, TrainedRun, TrialBounds
from kinarm.evaluation.metrics import METRICS
from kinarm.evaluation.outcomes import Outcomes
from kinarm.evaluation.statistics import Estimate, share_over_seeds, wilson_interval
from kinarm.policies.config import TrainingConfig

if TYPE_CHECKING:
    from kinarm.evaluation.experiments.study import Study

FIGURES = (
    *("success", "relative_success", "collision", "median_distance", "median_steps", "step_ratio"),
)
"""Figures of merit that a row tells of a training, as in `kinarm.evaluation.METRICS`."""

LEVELS = (0.5, 0.8)
"""Shares of success by which the speed of learning is told."""


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


def group_runs(study: "Study") -> tuple[Group, ...]:
    """Finished trainings of a study, those with the same settings but for the seed together."""
    shared: dict[tuple[str, str], list[Run]] = {}
    for run in study.finished:
        config = {k: v for k, v in run.settings["config"].items() if k != "seed"}
        shared.setdefault((run.entry.name, repr((run.learner, config))), []).append(run)
    return tuple(
        Group(
            label=_label(runs[0], study),
            entry=runs[0].entry,
            config=runs[0].config,
            choices=runs[0].choices,
            runs=tuple(study.finished[run] for run in runs),
            clocks=tuple(study.store.clock(run) for run in runs),
            bounds=study.bounds.get(runs[0].config.problem.digest),
        )
        for runs in shared.values()
    )


def _label(run: Run, study: "Study") -> str:
    """What to call the trainings with the settings of a run."""
    experiment, names = study.experiment, identity(run)
    if experiment.entries:
        parts = [run.entry.title or run.entry.name]
    else:
        several = {"learner": experiment.learners, "recipe": experiment.recipes}
        parts = [str(names[name]) for name, values in several.items() if len(values) > 1]
    if len({each.config.problem.name for each in study.runs}) > 1:
        parts.append(names["problem"])
    parts += [f"{shorter(field)}={shown(value)}" for field, value in run.choices.items()]
    return " ".join(parts) or f"{names['learner']} {names['recipe']} {names['problem']}"


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


def run_rows(study: "Study") -> list[dict[str, Any]]:
    """One row per finished training: learner, varied fields, figures of merit, times."""
    fields = _varied(study)
    rows = []
    for run, trained in study.finished.items():
        clock = study.store.clock(run)
        outcomes = Outcomes((trained.outcomes,), study.bounds.get(run.config.problem.digest))
        rows.append(
            {
                **({"entry": run.entry.name} if study.experiment.entries else {}),
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


def curve_rows(study: "Study") -> list[dict[str, Any]]:
    """One row per point of a learning curve, the ends included."""
    fields = _varied(study)
    return [
        {
            "entry": run.entry.name,
            **identity(run),
            **{field: run.choices.get(field) for field in fields},
            **point._asdict(),
            "seconds": seconds,
            "processor_seconds": processor_seconds,
        }
        for run, trained in study.finished.items()
        for point, seconds, processor_seconds in timed_curve(trained, study.store.clock(run))
    ]


def _varied(study: "Study") -> list[str]:
    """Fields that vary between the finished trainings."""
    return list(dict.fromkeys(field for run in study.finished for field in run.choices))


def run_table(study: "Study") -> "np.ndarray[Any, np.dtype[Any]]":
    """The `run_rows` as a structured array; fields that are no numbers are texts."""
    rows = run_rows(study)
    columns = {name: _column([row[name] for row in rows]) for name in (rows[0] if rows else ())}
    table = np.empty(len(rows), dtype=[(name, column.dtype) for name, column in columns.items()])
    for name, column in columns.items():
        table[name] = column
    return table


def _column(values: Sequence[Any]) -> NDArray[Any]:
    """Values of one kind as an array: numbers if all of them are, else texts."""
    numbers = all(isinstance(each, bool | int | float) for each in values)
    return np.array(values if numbers else ["" if v is None else shown(v) for v in values])


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
