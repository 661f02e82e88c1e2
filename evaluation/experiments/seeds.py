"""Several training seeds of one recipe, as an experiment."""

import re
import shutil
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from kinarm._fields import to_plain
from kinarm._files import check_folder, check_output
from kinarm._interrupts import telling
from kinarm._parallel import available_threads
from kinarm.errors import InvalidInputError, PolicyFileError, WorkerError
from kinarm.evaluation.experiments.curve import TrialSettings
from kinarm.evaluation.experiments.experiment import Experiment
from kinarm.evaluation.experiments.plan import Run, hash_of
from kinarm.evaluation.experiments.runs import TaskResult
from kinarm.evaluation.experiments.study import Study
from kinarm.policies.config import TrainingConfig
from kinarm.policies.learners import CurvePoint as IterationPoint
from kinarm.policies.learners import find_learner
from kinarm.policies.policy import Policy
from kinarm.policies.provenance import plain_settings
from kinarm.policies.training import TrainRequest, curve_path, say_findings, write_curve

TRIALS = TrialSettings(count=200, per_decade=0)
"""Trials that each policy faces at the end."""

UNDER_WAY = ".training"
"""Folder of unfinished trainings, beside the policies."""


class TrainedSeed(NamedTuple):
    """The finished training of one seed.

    Attributes
    ----------
    seed : int
        The seed.
    out : Path
        File of its policy.
    last : CurvePoint or None
        Its last iteration; None if finished earlier.
    """

    seed: int
    out: Path
    last: IterationPoint | None


def shared_name(config: TrainingConfig) -> str:
    """Learner, recipe and problem, as in the names of shipped policies."""
    parts = (find_learner(config.learner).name, config.recipe, config.problem.name)
    return re.sub(r"[^\w.-]+", "", "-".join(parts))


def train_seeds(
    training: TrainRequest, seeds: tuple[int, ...], jobs: int | None
) -> tuple[TrainedSeed, ...]:
    """Train several seeds; see `kinarm.evaluation.commands.train.SeedsRequest.run`.

    Parameters
    ----------
    training, seeds, jobs
        As for `kinarm.evaluation.commands.train.SeedsRequest`.
    """
    config, folder = training.config(), Path(training.out)
    find_learner(config.learner).check_installed()
    name = shared_name(config)
    outs = {
        Run(learner=config.learner, config=replace(config, seed=seed), trials=TRIALS): (
            folder / f"{name}-seed{seed}.npz"
        )
        for seed in seeds
    }
    _check_files(training, folder / UNDER_WAY, outs)
    missing = tuple(run for run, out in outs.items() if not _is_finished(training, run, out))
    check_folder(folder)
    # With other settings, it is another experiment.
    name = f"{name} {hash_of(to_plain(replace(config, seed=0)))}"
    experiment = Experiment(name=name, trials=TRIALS, bounds=False)
    study = Study(experiment, folder / UNDER_WAY, missing)
    for run in missing:  # what was killed before its policy was written
        study.store.path("runs", run).unlink(missing_ok=True)
    last: dict[Run, IterationPoint] = {}

    def leave(run: Run, result: TaskResult) -> None:
        write_curve(curve_path(outs[run]), result.iterations)
        study.policy(run).save(outs[run])
        last[run] = result.iterations[-1]

    def what_is_left(why: str) -> str:
        finished = sum(curve_path(out).exists() for out in outs.values())
        return (
            f"{why}: {finished} of {len(seeds)} seeds are finished; "
            "the same command with --resume goes on"
        )

    with telling(partial(what_is_left, "interrupted")):
        try:
            if missing:
                say_findings(config)
                jobs = min(jobs or available_threads(), len(missing))
                threads = max(1, available_threads() // jobs)
                study.run(jobs=jobs, threads=threads, on_trained=leave)
        except WorkerError as error:
            raise WorkerError(what_is_left("workers ended unexpectedly")) from error
    shutil.rmtree(study.store.folder, ignore_errors=True)
    return tuple(TrainedSeed(run.config.seed, out, last.get(run)) for run, out in outs.items())


def _check_files(training: TrainRequest, under_way: Path, outs: Mapping[Run, Path]) -> None:
    """Refuse files that are in the way or missing."""
    if training.resume:
        if not under_way.exists() and not any(out.exists() for out in outs.values()):
            raise PolicyFileError(f"nothing to resume: there is no {str(under_way)!r}")
        return
    if under_way.exists():
        raise InvalidInputError(
            f"{str(under_way)!r} holds unfinished trainings: go on with --resume, or delete it"
        )
    for out in outs.values():
        check_output(out, overwrite=training.overwrite, suffix=".npz")


def _is_finished(training: TrainRequest, run: Run, out: Path) -> bool:
    """Whether a training is to go on and has left its policy.

    With ``overwrite``, a policy with other settings is to be replaced.
    """
    if not training.resume or not out.exists():
        return False
    made = Policy.load(out).provenance
    wanted = plain_settings(run.config)
    changed = [k for k in wanted | made.config if wanted.get(k) != made.config.get(k)]
    change = ", ".join(changed) or made.problem.first_difference(run.config.problem)
    if change and not training.overwrite:
        raise InvalidInputError(
            f"{str(out)!r} is of another training ({change}): give the same options again, "
            "or another --out"
        )
    return not change
