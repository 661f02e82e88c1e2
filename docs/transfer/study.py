"""Policies of the paper's task 1 on tasks 2 and 3 and on another arm: two experiments.

The first trains policies on the first task. The second trains on the other ones, from scratch and
beginning with these policies. No training has a mirror, with which there would be nothing left to
ask: a policy with a mirror is as good on both sides.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from kinarm.evaluation import Study
from kinarm.evaluation.experiments.curve import CurvePoint, CurveTrials, TrialSettings
from kinarm.evaluation.experiments.executors import Executor
from kinarm.evaluation.experiments.experiment import Entry, Experiment
from kinarm.policies import Policy, recipe
from kinarm.problem import PROBLEMS, ReachProblem

FIRST_SEEDS = {"source": 0, "scratch": 1000, "warm": 2000}
"""Training seeds by role: no two trainings of a learner on a task share random numbers."""

RECIPES = {"ars": "tuned", "ppo": "paper"}

TESTED = {"tested_configurations": 4}
"""How steps are tested for contact, as when it was recorded."""

SOURCE = PROBLEMS["left"].replace(**TESTED)
"""The paper's task 1."""

OTHER_ARM = "lrmate200ic_5l"


@cache
def targets() -> tuple[ReachProblem, ...]:
    """The paper's tasks 2 and 3, and task 1 of another arm."""
    other = SOURCE.replace(name=f"{SOURCE.name}-{OTHER_ARM}", arm=OTHER_ARM)
    return PROBLEMS["right"].replace(**TESTED), PROBLEMS["both"].replace(**TESTED), other


@dataclass(frozen=True, kw_only=True)
class Protocol:
    """Trials of trained policies, and of those in training, which are looked at so often."""

    trials: int = 4000
    seed: int = 0
    looks: int = 80
    look_trials: int = 1000
    look_seed: int = 1

    @property
    def settings(self) -> TrialSettings:
        """The same for an experiment."""
        curve = CurveTrials(
            points=self.looks, spacing="geometric", count=self.look_trials, seed=self.look_seed
        )
        return TrialSettings(count=self.trials, seed=self.seed, curve=curve)


class Training(NamedTuple):
    """A training: on the first task, or on another one from scratch or with a warm start."""

    learner: str
    role: str
    problem: ReachProblem
    length: float
    seed: int


class TransferRun(NamedTuple):
    """A trained policy, and how it did in the course of its training, in so many trials."""

    policy: Policy
    looks: tuple[CurvePoint, ...]
    trials: int

    def first_look(self, level: float) -> CurvePoint | None:
        """The first one with such a share of success; None if there is none."""
        enough = level * self.trials
        return next((p for p in self.looks if round(p.success * self.trials) >= enough), None)


@dataclass(frozen=True, kw_only=True)
class TransferStudy:
    """What is trained: learners, seeds, shares of the recipe's iterations, other settings."""

    learners: tuple[str, ...] = ("ars", "ppo")
    seeds: int = 4
    lengths: tuple[float, ...] = (1.0, 0.1)
    settings: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    protocol: Protocol = field(default_factory=Protocol)

    def run(self, folder: Path, executor: Executor | None = None) -> dict[Training, TransferRun]:
        """Carry out what is missing in a folder; in the order of `trainings`."""
        sources = Study(self._sources(), folder / "sources").run(executor=executor)
        found = dict(self._runs(sources))
        begun = folder / "policies"
        begun.mkdir(exist_ok=True)
        for training, run in found.items():
            run.policy.save(self._begun(begun, training.learner, training.seed))
        others = Study(self._others(begun), folder / "others").run(executor=executor)
        found |= dict(self._runs(others))
        return {training: found[training] for training in self.trainings()}

    def trainings(self) -> Iterator[Training]:
        """All trainings; those that others begin with come first."""
        seeds = range(self.seeds)
        for learner, seed in product(self.learners, seeds):
            yield Training(learner, "source", SOURCE, 1.0, seed)
        for problem, learner, length, seed in product(
            targets(), self.learners, self.lengths, seeds
        ):
            for role in ("scratch", "warm"):
                yield Training(learner, role, problem, length, FIRST_SEEDS[role] + seed)

    def _experiment(self, name: str, entries: list[Entry]) -> Experiment:
        return Experiment(
            name=name,
            entries=tuple(entries),
            trials=self.protocol.settings,
            bounds=False,
            fixed={f"problem.stepping.{field}": value for field, value in TESTED.items()},
        )

    def _sources(self) -> Experiment:
        """Trainings on the first task."""
        entries = [
            Entry(
                name=f"{learner} source 1",
                learner=learner,
                recipe=RECIPES[learner],
                problems=(SOURCE.name,),
                seeds=self.seeds,
                fixed=self._fixed(learner),
            )
            for learner in self.learners
        ]
        return self._experiment("transfer-sources", entries)

    def _others(self, begun: Path) -> Experiment:
        """Trainings on the other tasks."""
        entries = []
        for problem, learner, length in product(targets(), self.learners, self.lengths):
            whole = recipe(learner, RECIPES[learner], problem=problem, **self._fixed(learner))
            fixed = {
                **self._fixed(learner),
                **({"problem.arm": OTHER_ARM} if problem.arm != SOURCE.arm else {}),
                "problem.name": problem.name,
                "iterations": max(1, round(length * whole.iterations)),
            }
            shared = {"learner": learner, "recipe": RECIPES[learner]}
            shared["problems"] = (SOURCE.name if problem.arm != SOURCE.arm else problem.name,)
            kind = f"{problem.name} {length}"
            entries.append(
                Entry(
                    name=f"{learner} scratch {length} {kind}",
                    seeds=self.seeds,
                    first_seed=FIRST_SEEDS["scratch"],
                    fixed=fixed,
                    **shared,
                )
            )
            entries += [
                Entry(
                    name=f"{learner} warm {length} {kind} {seed}",
                    seeds=1,
                    first_seed=FIRST_SEEDS["warm"] + seed,
                    fixed={**fixed, "initial_policy": str(self._begun(begun, learner, seed))},
                    **shared,
                )
                for seed in range(self.seeds)
            ]
        return self._experiment("transfer-others", entries)

    def _fixed(self, learner: str) -> dict[str, Any]:
        return {"symmetric": False, **self.settings.get(learner, {})}

    def _begun(self, folder: Path, learner: str, seed: int) -> Path:
        return folder / f"{learner}-{seed}.npz"

    def _runs(self, study: Study) -> Iterator[tuple[Training, TransferRun]]:
        problems = {problem.name: problem for problem in (SOURCE, *targets())}
        for run, trained in study.finished.items():
            learner, role, length, *_ = run.entry.name.split()
            problem = problems[run.config.problem.name]
            training = Training(learner, role, problem, float(length), run.config.seed)
            looks = trained.curve
            yield training, TransferRun(study.policy(run), looks, self.protocol.look_trials)
