"""What a training came to in the course of it, and the files in which that is kept."""

import hashlib
import json
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from kinarm import SEMANTICS
from kinarm._archive import load_json, reading
from kinarm._fields import to_plain
from kinarm._files import write_text
from kinarm._validation import MOST_TRIALS, whole_number
from kinarm.errors import KinarmError
from kinarm.evaluation.comparison.learners import ComparedLearner
from kinarm.policies.provenance import package_versions
from kinarm.policies.recipes import PER_TRAINING, recipe
from kinarm.problem import ReachProblem


@dataclass(frozen=True, kw_only=True)
class Protocol:
    """How trainings are judged.

    Parameters
    ----------
    trials, seed : int
        Size and seed of the set of trials that policies face.
    first : int
        Environment steps after which they face it for the first time.
    per_decade : int
        How often while the environment steps grow tenfold.
    """

    trials: int = 1000
    seed: int = 0
    first: int = 1000
    per_decade: int = 10

    def __post_init__(self) -> None:
        whole_number("trials", self.trials, 1, MOST_TRIALS)
        whole_number("seed", self.seed, 0)

    def checkpoint(self, number: int) -> float:
        """Environment steps after which policies are judged for the time ``number``, from 0."""
        return float(self.first * 10.0 ** (number / self.per_decade))


class CurvePoint(NamedTuple):
    """How the policy did at one point of a training.

    Attributes
    ----------
    environment_steps : int
        Steps taken so far.
    seconds, processor_seconds : float
        Wall time and processor time of the training so far, without judging.
    successes, collisions : int
        Trials that ended so.
    median_distance : float
        Of the final distances [m].
    steps_to_success : float or None
        Median over the trials that succeeded; None if there is none, or it was not recorded.
    """

    environment_steps: int
    seconds: float
    processor_seconds: float
    successes: int
    collisions: int
    median_distance: float
    steps_to_success: float | None = None


@dataclass(frozen=True, eq=False)
class PlannedRun:
    """A training of a comparison.

    Attributes
    ----------
    learner : ComparedLearner
        Who learns.
    problem : ReachProblem
        What.
    seed : int
        Of the training.
    steps : int or None
        Environment steps after which it ends.
    protocol : Protocol
        How it is judged.
    """

    learner: ComparedLearner
    problem: ReachProblem
    seed: int
    steps: int | None
    protocol: Protocol

    @cached_property
    def settings(self) -> dict[str, Any]:
        """Everything that the run depends on, as JSON holds it."""
        config = to_plain(self.config) or {}
        return {
            "learner": to_plain(self.learner),
            "recipe": {name: config[name] for name in config if name not in PER_TRAINING},
            "problem": self.problem.pinned.to_json(),
            "seed": self.seed,
            "steps": self.steps,
            "protocol": asdict(self.protocol),
            "semantics": SEMANTICS,
            "versions": package_versions(),
        }

    @cached_property
    def config(self) -> Any:
        """Settings of the training if the learner is a recipe of kinarm's, and None otherwise."""
        learner = self.learner
        if not learner.is_recipe:
            return None
        changes = {**learner.settings, "problem": self.problem, "seed": self.seed}
        return recipe(learner.algorithm, learner.recipe, **changes)

    @property
    def name(self) -> str:
        """File name; other settings have another one."""
        digest = hashlib.sha256(json.dumps(self.settings, sort_keys=True).encode()).hexdigest()
        return f"{self.learner.name}-{self.problem.name}-seed{self.seed}-{digest[:8]}"


def planned_runs(
    learners: Iterable[ComparedLearner],
    problems: Iterable[ReachProblem],
    seeds: int,
    steps: int | None,
    protocol: Protocol,
) -> list[PlannedRun]:
    """All trainings of a comparison, seed by seed, so that the first results cover everything."""
    each = product(range(seeds), problems, learners)
    return [PlannedRun(learner, problem, seed, steps, protocol) for seed, problem, learner in each]


def save_run(folder: Path, run: PlannedRun, curve: Iterable[CurvePoint]) -> None:
    """Write a finished training.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    entries = {"settings": run.settings, "curve": [point._asdict() for point in curve]}
    write_text(folder / f"{run.name}.json", json.dumps(entries) + "\n")


def load_run(folder: Path, run: PlannedRun) -> tuple[CurvePoint, ...] | None:
    """Read a finished training; None if it is not finished, or its file is damaged."""
    path = folder / f"{run.name}.json"
    with suppress(KinarmError), reading(repr(str(path)), "run", KinarmError):
        entries = load_json(path, "run", KinarmError)
        return tuple(CurvePoint(**point) for point in entries["curve"]) or None
    return None
