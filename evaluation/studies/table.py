"""What the trainings of a study came to, as tables."""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kinarm._files import write_atomically, write_text
from kinarm.errors import MissingExtraError
from kinarm.evaluation.metrics import METRICS
from kinarm.evaluation.outcomes import Outcomes
from kinarm.evaluation.statistics import Estimate, share_over_seeds
from kinarm.evaluation.studies.planning import PlannedRun
from kinarm.evaluation.studies.runs import TrainedRun, TrialBounds
from kinarm.policies.config import TrainingConfig

if TYPE_CHECKING:
    from kinarm.evaluation.studies.study import Study

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
        What sets them apart from the other groups of the study.
    config : TrainingConfig
        Settings of the first of them.
    choices : mapping
        What of them varies in the study, by field.
    runs : tuple of TrainedRun
        The trainings by seed.
    bounds : TrialBounds or None
        What the oracle knows about their trials.
    """

    label: str
    config: TrainingConfig
    choices: Mapping[str, Any]
    runs: tuple[TrainedRun, ...]
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


def figures_of(outcomes: Outcomes) -> dict[str, float]:
    """Figures of merit of some trainings; NaN for unknown ones."""
    found = {}
    for name in FIGURES:
        known = outcomes.bounds is not None or not METRICS[name].needs_bounds
        value = METRICS[name].formula(outcomes) if known else None
        found[name] = float("nan") if value is None else float(value)
    return found


def group_runs(study: "Study") -> tuple[Group, ...]:
    """Finished trainings of a study, those with the same settings but for the seed together."""
    shared: dict[str, list[PlannedRun]] = {}
    for run in study.finished:
        config = {k: v for k, v in run.settings["config"].items() if k != "seed"}
        shared.setdefault(repr((run.learner, config)), []).append(run)
    apart = _distinguishing(study)
    return tuple(
        Group(
            label=" ".join(_label(runs[0], apart)),
            config=runs[0].config,
            choices=runs[0].choices,
            runs=tuple(study.finished[run] for run in runs),
            bounds=study.bounds.get(runs[0].config.problem.digest),
        )
        for runs in shared.values()
    )


def _distinguishing(study: "Study") -> tuple[str, ...]:
    """Which of learner, recipe and problem differ within a study."""
    specification = study.specification
    several = {
        "learner": specification.learners,
        "recipe": specification.recipes,
        "problem": specification.problems,
    }
    return tuple(name for name, values in several.items() if len(values) > 1)


def _label(run: PlannedRun, apart: Sequence[str]) -> list[str]:
    """What to call the trainings with the settings of a run."""
    names = identity(run)
    parts = [str(names[name]) for name in apart]
    parts += [f"{shorter(field)}={shown(value)}" for field, value in run.choices.items()]
    return parts or [f"{names['learner']} {names['recipe']} {names['problem']}"]


def identity(run: PlannedRun) -> dict[str, Any]:
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
    fields = dict.fromkeys(field for run in study.finished for field in run.choices)
    rows = []
    for run, trained in study.finished.items():
        made = study.store.made(run)
        outcomes = Outcomes((trained.outcomes,), study.bounds.get(run.config.problem.digest))
        rows.append(
            {
                **identity(run),
                **{field: run.choices.get(field) for field in fields},
                "iterations": trained.last.iteration,
                "environment_steps": trained.last.environment_steps,
                "seconds": float(made.get("seconds", "nan")),
                "processor_seconds": float(made.get("processor_seconds", "nan")),
                **figures_of(outcomes),
                "key": run.key,
            }
        )
    return rows


def run_table(study: "Study") -> "np.ndarray[Any, np.dtype[Any]]":
    """The same as a structured array; fields that are no numbers are texts."""
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


def write_csv(study: "Study", path: Path) -> None:
    """Write one line per finished training.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    rows, text = run_rows(study), io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]) if rows else ["key"], lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _cell(value) for name, value in row.items()} for row in rows)
    write_text(path, text.getvalue())


def _cell(value: Any) -> Any:
    return shown(value) if isinstance(value, list | tuple) else value


def write_parquet(study: "Study", path: Path) -> None:
    """Write one row per finished training.

    Raises
    ------
    MissingExtraError
        If pyarrow is not installed.
    OutputError
        If the file cannot be written.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise MissingExtraError("pyarrow", "study") from error
    table = run_table(study)
    arrow = pyarrow.table({name: table[name] for name in table.dtype.names or ()})
    write_atomically(path, lambda file: pyarrow.parquet.write_table(arrow, file))
