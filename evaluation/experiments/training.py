"""Trainings of one recipe, as an experiment that leaves policies and learning curves."""

import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from kinarm._fields import to_plain
from kinarm._files import check_output, write_text
from kinarm._interrupts import GOES_ON, telling
from kinarm._parallel import available_threads
from kinarm._tables import csv_text
from kinarm.evaluation.experiments.curve import TrialSettings
from kinarm.evaluation.experiments.executors import Work
from kinarm.evaluation.experiments.experiment import Experiment
from kinarm.evaluation.experiments.plan import Run, hash_of
from kinarm.evaluation.experiments.runs import TaskResult
from kinarm.evaluation.experiments.study import Study
from kinarm.policies.config import TrainingConfig
from kinarm.policies.learners import CurvePoint, find_learner
from kinarm.policies.policy import Policy
from kinarm.problem_options import say_choices

TRIALS = TrialSettings(count=1, per_decade=0)
"""Trials of a policy at the end: as few as an experiment can have."""


class Trained(NamedTuple):
    """A finished training.

    Attributes
    ----------
    seed : int
        Its seed.
    out : Path
        File of its policy.
    curve : tuple of CurvePoint
        Its iterations; empty if finished earlier.
    """

    seed: int
    out: Path
    curve: tuple[CurvePoint, ...]

    @property
    def policy(self) -> Policy:
        """The policy."""
        return Policy.load(self.out)


class ThisProcess:
    """An executor for one task, whose error ends it as it is."""

    def map(self, work: Work, tasks: Sequence[Any]) -> Iterator[tuple[Any, Any]]:
        """Do the work for every task; see `Executor.map`."""
        return ((task, work(task)) for task in tasks)


def shared_name(config: TrainingConfig) -> str:
    """Learner, recipe and problem, as in the names of shipped policies."""
    parts = (find_learner(config.learner).name, config.recipe, config.problem.name)
    return re.sub(r"[^\w.-]+", "", "-".join(parts))


def train_all(
    config: TrainingConfig,
    outs: Mapping[int, Path],
    folder: Path,
    *,
    jobs: int | None = None,
    overwrite: bool = False,
    keep: bool = True,
) -> tuple[Trained, ...]:
    """Train seeds that are not finished, and write a policy and a learning curve for each.

    Parameters
    ----------
    config : TrainingConfig
        The settings.
    outs : mapping of int to Path
        Files of the policies, by seed.
    folder : Path
        Folder of the experiment, which says how far all are.
    jobs : int, optional
        Seeds at a time, one a processor by default.
    overwrite, keep : bool
        Replace earlier policies; keep the folder when all are finished.
    """
    find_learner(config.learner).check_installed()
    config = replace(config, problem=config.problem.pinned)
    runs = {
        Run(learner=config.learner, config=replace(config, seed=seed), trials=TRIALS): out
        for seed, out in outs.items()
    }
    # With other settings, it is another experiment, which the folder refuses.
    name = f"{shared_name(config)} {hash_of(to_plain(config))}"
    experiment = Experiment(name=name, trials=TRIALS, bounds=False)
    study = Study(experiment, folder, tuple(runs))
    study.store.check(experiment)
    for run, out in runs.items():
        kept = study.store.path("runs", run)
        if not (out.exists() and kept.exists()):
            check_output(out, overwrite=overwrite, suffix=".npz")
            kept.unlink(missing_ok=True)  # what was killed before its policy was written
    curves: dict[Run, tuple[CurvePoint, ...]] = {}

    def leave(run: Run, result: TaskResult) -> None:
        curve = curves[run] = result.iterations
        rows = [{"iteration": n, **point._asdict()} for n, point in enumerate(curve, start=1)]
        write_text(runs[run].with_suffix(".curve.csv"), csv_text(rows))
        study.policy(run).save(runs[run])

    with telling(lambda: GOES_ON):
        try:
            if missing := len(study.missing):
                say_findings(config)
                jobs = min(jobs or available_threads(), missing)
                threads = max(1, available_threads() // jobs)
                where = ThisProcess() if len(runs) == 1 else None
                study.run(jobs=jobs, threads=threads, executor=where, on_trained=leave)
        finally:
            if not keep:
                study.store.clear(runs)
    return tuple(Trained(run.config.seed, out, curves.get(run, ())) for run, out in runs.items())


def say_findings(config: TrainingConfig) -> None:
    """Say on standard error what was chosen, and of a ``symmetric`` without effect."""
    from kinarm.policies.mirror import missing_mirror

    say_choices([config.problem])
    if getattr(config, "symmetric", False) and (reason := missing_mirror(config.problem)):
        sys.stderr.write(f"symmetric has no effect: {reason}\n")
