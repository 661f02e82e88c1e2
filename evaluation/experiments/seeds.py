"""Several training seeds of one recipe: an experiment that leaves a policy of each."""

import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from kinarm._fields import to_plain
from kinarm._files import absolute, check_folder, check_output
from kinarm._interrupts import telling
from kinarm._parallel import available_threads
from kinarm.errors import InvalidInputError, PolicyFileError, WorkerError
from kinarm.evaluation.experiments.curve import TrialSettings
from kinarm.evaluation.experiments.experiment import Experiment
from kinarm.evaluation.experiments.plan import Run, hash_of
from kinarm.evaluation.experiments.study import Study
from kinarm.evaluation.experiments.train import TaskResult
from kinarm.policies.learners import CurvePoint as IterationPoint
from kinarm.policies.learners import find_learner, learner_of
from kinarm.policies.policy import Policy
from kinarm.policies.provenance import plain_settings
from kinarm.policies.training import TrainRequest, curve_path, say_findings, write_curve

TRIALS = TrialSettings(count=200, per_decade=0)
"""Trials that each policy faces at the end; figures of merit are for ``kinarm-eval``."""

UNDER_WAY = ".training"
"""Folder, beside the policies, of what is under way."""


class TrainedSeed(NamedTuple):
    """What the training of one seed came to.

    Attributes
    ----------
    seed : int
        The seed.
    out : Path
        File of its policy.
    last : CurvePoint or None
        Its last iteration; None if it was finished earlier.
    """

    seed: int
    out: Path
    last: IterationPoint | None


@dataclass(frozen=True)
class SeedTrainings:
    """Trainings of several seeds, as a request says.

    Parameters
    ----------
    training : TrainRequest
        What is trained; ``out`` is the folder of the policies.
    seeds : tuple of int
        The seeds.
    jobs : int or None
        Seeds at a time; one a processor by default.
    """

    training: TrainRequest
    seeds: tuple[int, ...]
    jobs: int | None = None

    @property
    def folder(self) -> Path:
        """Folder of the policies."""
        return Path(self.training.out)

    def run(self) -> tuple[TrainedSeed, ...]:
        """Train what is missing; see `kinarm.evaluation.commands.train.SeedsRequest.run`."""
        runs = self._runs()
        self._check_files(runs)
        missing = tuple(run for run in runs if not self._is_finished(run))
        check_folder(self.folder)
        if missing:
            say_findings(missing[0].config)
        last: dict[Run, IterationPoint] = {}

        def leave(run: Run, result: TaskResult) -> None:
            write_curve(curve_path(self._out(run)), result.iterations)
            study.policy(run).save(self._out(run))
            last[run] = result.iterations[-1]

        study = Study(self._experiment(runs[0]), self.folder / UNDER_WAY, missing)
        with telling(partial(self._what_is_left, "interrupted")):
            try:
                self._train(study, leave)
            except WorkerError as error:
                raise WorkerError(self._what_is_left("workers ended unexpectedly")) from error
        shutil.rmtree(study.store.folder, ignore_errors=True)
        return tuple(TrainedSeed(run.config.seed, self._out(run), last.get(run)) for run in runs)

    def _runs(self) -> tuple[Run, ...]:
        """The trainings, whether finished or not."""
        first = self.training.config()
        learner_of(first).check_installed()
        return tuple(
            Run(learner=first.learner, config=replace(first, seed=seed), trials=TRIALS)
            for seed in self.seeds
        )

    def _experiment(self, run: Run) -> Experiment:
        """What the trainings are called; with other settings, otherwise."""
        name = f"{self._name(run)} {hash_of(to_plain(replace(run.config, seed=0)))}"
        return Experiment(name=name, trials=TRIALS, bounds=False)

    def _name(self, run: Run) -> str:
        """Learner, recipe and problem, as in names of files."""
        parts = (find_learner(run.learner).name, run.config.recipe, run.config.problem.name)
        return re.sub(r"[^\w.-]+", "", "-".join(parts))

    def _out(self, run: Run) -> Path:
        """File of the policy of a training."""
        return self.folder / f"{self._name(run)}-seed{run.config.seed}.npz"

    def _check_files(self, runs: tuple[Run, ...]) -> None:
        """Refuse files that are in the way, or that are missing."""
        under_way = self.folder / UNDER_WAY
        if self.training.resume:
            if not under_way.exists() and not any(self._out(run).exists() for run in runs):
                raise PolicyFileError(f"nothing to resume: there is no {str(under_way)!r}")
            return
        if under_way.exists():
            raise InvalidInputError(
                f"{str(under_way)!r} holds unfinished trainings: go on with --resume, or delete it"
            )
        for run in runs:
            check_output(self._out(run), overwrite=self.training.overwrite, suffix=".npz")

    def _is_finished(self, run: Run) -> bool:
        """Whether a training is to go on and has left its policy.

        With ``overwrite``, a policy with other settings is one that was to be replaced.
        """
        out = self._out(run)
        if not self.training.resume or not out.exists():
            return False
        made = Policy.load(out).provenance
        wanted = plain_settings(run.config)
        changed = [k for k in wanted | made.config if wanted.get(k) != made.config.get(k)]
        change = ", ".join(changed) or made.problem.first_difference(run.config.problem)
        if change and not self.training.overwrite:
            raise InvalidInputError(
                f"{str(out)!r} is of another training ({change}): give the same options again, "
                "or another --out"
            )
        return not change

    def _train(self, study: Study, leave: Callable[[Run, TaskResult], None]) -> None:
        """Train what is missing in worker processes."""
        if not study.runs:
            return
        for run in study.runs:  # what was killed before its policy was written
            study.store.run_path(run).unlink(missing_ok=True)
        jobs = min(self.jobs or available_threads(), len(study.runs))
        threads = max(1, available_threads() // jobs)
        logs = self.training.tensorboard and absolute(self.training.tensorboard)
        study.run(jobs=jobs, threads=threads, logs=logs or None, on_trained=leave)

    def _what_is_left(self, why: str) -> str:
        """Why trainings end early, what that leaves, and how to go on."""
        finished = sum(curve_path(self._out(run)).exists() for run in self._runs())
        return (
            f"{why}: {finished} of {len(self.seeds)} seeds are finished; "
            "the same command with --resume goes on"
        )
