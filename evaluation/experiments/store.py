"""The folder of an experiment."""

import json
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomli_w

from kinarm._archive import load_json, reading
from kinarm._files import check_folder, only_writer, write_atomically, write_text
from kinarm.errors import InvalidInputError, KinarmError
from kinarm.evaluation.experiments.executors import Failure
from kinarm.evaluation.experiments.experiment import Experiment
from kinarm.evaluation.experiments.plan import Run
from kinarm.evaluation.experiments.runs import (
    Checkpoint,
    Clock,
    TrainedRun,
    TrialBounds,
    clock_of,
    load_bounds,
    load_checkpoint,
    load_run,
    run_of_file,
)
from kinarm.evaluation.experiments.train import BoundTask, RunTask, TaskResult
from kinarm.policies.provenance import package_versions, source_commit

SPECIFICATION = "study.toml"
"""File of the experiment in its folder."""

FOLDERS = ("runs", "made", "failed", "bounds", "checkpoints")


@dataclass(frozen=True)
class Store:
    """The folder of an experiment and its results.

    Every finished training is one file under the hash of its settings, ``runs/KEY.npz``, and there
    is no other state: what has no such file is still to be done. How long it took, which no two
    machines agree on, lies apart in ``made/KEY.json``; why a training failed, until it succeeds, in
    ``failed/KEY.json``; how far it is in ``checkpoints/KEY.npz``; and what the oracle knows about
    trials in ``bounds/KEY.npz``.
    """

    folder: Path

    def run_path(self, run: Run) -> Path:
        """Where a training is kept."""
        return self.folder / "runs" / f"{run.key}.npz"

    def made_path(self, run: Run) -> Path:
        """Where it is kept how a training was made."""
        return self.folder / "made" / f"{run.key}.json"

    def checkpoint_path(self, run: Run) -> Path:
        """Where a training that is not finished saves how far it is."""
        return self.folder / "checkpoints" / f"{run.key}.npz"

    def failure_path(self, task: Run | RunTask | BoundTask) -> Path:
        """Where it is kept why a training, or the search for bounds, failed."""
        return self.folder / "failed" / f"{task.key}.json"

    def bounds_path(self, task: BoundTask) -> Path:
        """Where bounds are kept."""
        return self.folder / "bounds" / f"{task.key}.npz"

    @contextmanager
    def writing(self, experiment: Experiment) -> Iterator["Store"]:
        """Claim the folder for an experiment, and keep other processes from writing to it.

        Raises
        ------
        InvalidInputError
            If it is the folder of another experiment.
        OutputError
            If it cannot be written to, or another process does.
        """
        check_folder(self.folder)
        marker = self.folder / SPECIFICATION
        with only_writer(self.folder):
            if marker.exists():
                there = Experiment.load(marker).name
                if there != experiment.name:
                    raise InvalidInputError(
                        f"{str(self.folder)!r} is of the experiment {there!r}, not of "
                        f"{experiment.name!r}: name another folder with --out"
                    )
            for name in FOLDERS:
                check_folder(self.folder / name)
            write_text(marker, tomli_w.dumps(experiment.to_json()))
            yield self

    def save(self, task: RunTask | BoundTask, result: TaskResult | Failure) -> None:
        """Keep what came of a task.

        Parameters
        ----------
        task : RunTask or BoundTask
            The task.
        result : TaskResult or Failure
            What it came to, or why it failed.

        Raises
        ------
        OutputError
            If a file cannot be written.
        """
        failure = self.failure_path(task)
        if isinstance(result, Failure):
            entries = {"name": task.name, **result._asdict()}
            write_text(failure, json.dumps(entries, indent=1) + "\n")
            return
        path = self.bounds_path(task) if isinstance(task, BoundTask) else self.run_path(task.run)
        if isinstance(task, RunTask):
            made = {"versions": package_versions(), "commit": source_commit()}
            entries = {**result.clock._asdict(), **made}
            write_text(self.made_path(task.run), json.dumps(entries) + "\n")
        write_atomically(path, lambda file: file.write(result.content))
        failure.unlink(missing_ok=True)
        if isinstance(task, RunTask):
            self.checkpoint_path(task.run).unlink(missing_ok=True)

    def load(self, runs: Iterable[Run]) -> dict[Run, TrainedRun]:
        """Read those of the trainings that are finished and whose file is not damaged."""
        found = {}
        for run in runs:
            path = self.run_path(run)
            with suppress(InvalidInputError):
                if path.exists():
                    found[run] = load_run(path, run)
        return found

    def starts(self, runs: Iterable[Run]) -> dict[Run, Checkpoint]:
        """Where trainings can go on that were interrupted, or that shorter ones began."""
        runs = list(runs)
        found = self._shorter_runs([run for run in runs if run.config.can_extend])
        for run in runs:
            path = self.checkpoint_path(run)
            with suppress(InvalidInputError):
                if path.exists():
                    saved = load_checkpoint(path, run)
                    if run not in found or saved.state.iteration > found[run].state.iteration:
                        found[run] = saved
        return found

    def _shorter_runs(self, runs: Collection[Run]) -> dict[Run, Checkpoint]:
        """The longest of the shorter trainings, whichever experiment they were for."""
        wanted: dict[str, list[Run]] = {}
        for run in runs:
            wanted.setdefault(run.base_key, []).append(run)
        found: dict[Run, Checkpoint] = {}
        for path in sorted((self.folder / "runs").glob("*.npz")) if wanted else ():
            with suppress(KinarmError):
                shorter = run_of_file(path)
                longer = wanted.get(shorter.base_key, ())
                if not longer or shorter.key != path.stem:
                    continue
                end = self._end_of(shorter)
                for run in longer:
                    before = found[run].state.iteration if run in found else 0
                    if end is not None and before < end.state.iteration < run.config.iterations:
                        found[run] = end
        return found

    def _end_of(self, run: Run) -> Checkpoint | None:
        """The state that a finished training ended in, if that is kept."""
        trained = load_run(self.run_path(run), run, whole=True)
        if trained.state is None:
            return None
        distances = () if trained.curve_distance is None else tuple(trained.curve_distance)
        return Checkpoint(trained.state, trained.curve, distances, self.clock(run))

    def made(self, run: Run) -> Mapping[str, Any]:
        """How a training was made: times [s], versions and commit; empty if unknown."""
        path = self.made_path(run)
        with suppress(KinarmError), reading(repr(str(path)), "record", KinarmError):
            entries = load_json(path, "record", KinarmError)
            clock_of(entries)
            return dict(entries)
        return {}

    def clock(self, run: Run) -> Clock:
        """How long a training took; nothing if unknown."""
        return clock_of(self.made(run))

    def failure(self, task: Run | BoundTask) -> str | None:
        """Why a training failed, in a line; None if it did not."""
        path = self.failure_path(task)
        with suppress(KinarmError), reading(repr(str(path)), "record", KinarmError):
            return str(load_json(path, "record", KinarmError)["error"])
        return None

    def bounds(self, task: BoundTask) -> TrialBounds | None:
        """Read bounds; None if they are not known, or their file is damaged."""
        with suppress(InvalidInputError):
            return load_bounds(self.bounds_path(task), task.trials.count)
        return None
