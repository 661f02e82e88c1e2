"""Several training seeds of one recipe, as an experiment."""

import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from kinarm._fields import to_plain
from kinarm._files import check_output
from kinarm._interrupts import telling
from kinarm._parallel import available_threads
from kinarm.errors import WorkerError
from kinarm.evaluation.experiments.curve import TrialSettings
from kinarm.evaluation.experiments.experiment import Experiment
from kinarm.evaluation.experiments.plan import Run, hash_of
from kinarm.evaluation.experiments.runs import TaskResult
from kinarm.evaluation.experiments.study import Study
from kinarm.policies.config import TrainingConfig
from kinarm.policies.learners import CurvePoint as IterationPoint
from kinarm.policies.learners import find_learner
from kinarm.policies.training import TrainRequest, curve_path, say_findings, write_curve

TRIALS = TrialSettings(count=200, per_decade=0)
"""Trials that each policy faces at the end."""

TRAININGS = ".training"
"""Folder of the trainings, beside the policies."""


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
    # With other settings, it is another experiment, which the folder refuses.
    settings = hash_of(to_plain(replace(config, seed=0)))
    experiment = Experiment(name=f"{name} {settings}", trials=TRIALS, bounds=False)
    study = Study(experiment, folder / TRAININGS / name, tuple(outs))
    study.store.check(experiment)
    for run in (run for run, out in outs.items() if not out.exists()):
        # What was killed before its policy was written.
        study.store.path("runs", run).unlink(missing_ok=True)
    for run in study.missing:
        check_output(outs[run], overwrite=training.overwrite, suffix=".npz")
    last: dict[Run, IterationPoint] = {}

    def leave(run: Run, result: TaskResult) -> None:
        write_curve(curve_path(outs[run]), result.iterations)
        study.policy(run).save(outs[run])
        last[run] = result.iterations[-1]

    def what_is_left(why: str) -> str:
        finished = sum(study.store.path("runs", run).exists() for run in outs)
        return f"{why}: {finished} of {len(seeds)} seeds are finished; the same command goes on"

    with telling(partial(what_is_left, "interrupted")):
        try:
            if missing := len(study.missing):
                say_findings(config)
                jobs = min(jobs or available_threads(), missing)
                threads = max(1, available_threads() // jobs)
                study.run(jobs=jobs, threads=threads, on_trained=leave)
        except WorkerError as error:
            raise WorkerError(what_is_left("workers ended unexpectedly")) from error
    return tuple(TrainedSeed(run.config.seed, out, last.get(run)) for run, out in outs.items())
