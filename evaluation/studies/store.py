"""The folder of a study."""

import json
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomli_w

from kinarm._archive import load_json, reading
from kinarm._files import check_folder, only_writer, write_atomically, write_text
from kinarm.errors import InvalidInputError, KinarmError
from kinarm.evaluation.studies.planning import PlannedRun
from kinarm.evaluation.studies.runs import (
    RunClock,
    TrainedRun,
    TrialBounds,
    WholeRun,
    load_bounds,
    load_run,
    load_whole_run,
    planned_run,
)
from kinarm.evaluation.studies.specification import StudySpecification
from kinarm.evaluation.studies.training import BoundTask, RunTask, TaskResult
from kinarm.policies.provenance import package_versions, source_commit

SPECIFICATION = "study.toml"


@dataclass(frozen=True)
class StudyStore:
    """The folder of a study and its results.

    Every finished training is one file under the hash of its settings, ``runs/KEY.npz``, and there
    is no other state: what has no such file is still to be done. How long it took, which no two
    machines agree on, lies apart in ``made/KEY.json``; why a training failed, until it succeeds, in
    ``failed/KEY.json``; and what the oracle knows about trials in ``bounds/KEY.npz``.
    """

    folder: Path

    def run_path(self, run: PlannedRun) -> Path:
        """Where a training is kept."""
        return self.folder / "runs" / f"{run.key}.npz"

    def made_path(self, run: PlannedRun) -> Path:
        """Where it is kept how a training was made."""
        return self.folder / "made" / f"{run.key}.json"

    def failure_path(self, task: PlannedRun | BoundTask) -> Path:
        """Where it is kept why a training, or the search for bounds, failed."""
        return self.folder / "failed" / f"{task.key}.json"

    def bounds_path(self, task: BoundTask) -> Path:
        """Where bounds are kept."""
        return self.folder / "bounds" / f"{task.key}.npz"

    @contextmanager
    def writing(self, study: StudySpecification) -> Iterator[None]:
        """Claim the folder for a study, and keep other processes from writing to it.

        Raises
        ------
        InvalidInputError
            If it is the folder of another study.
        OutputError
            If it cannot be written to, or another process does.
        """
        check_folder(self.folder)
        marker = self.folder / SPECIFICATION
        with only_writer(self.folder):
            if marker.exists():
                held = StudySpecification.load(marker).name
                if held != study.name:
                    raise InvalidInputError(
                        f"{str(self.folder)!r} holds the study {held!r}, not {study.name!r}: "
                        "name another folder with --out"
                    )
            for name in ("runs", "made", "failed", "bounds"):
                check_folder(self.folder / name)
            write_text(marker, tomli_w.dumps(study.to_json()))
            yield

    def save(self, task: RunTask | BoundTask, result: TaskResult) -> None:
        """Keep what came of a task.

        Raises
        ------
        OutputError
            If a file cannot be written.
        """
        kept = task.run if isinstance(task, RunTask) else task
        failure = self.failure_path(kept)
        if result.error:
            entries = {"name": task.name, "error": result.error, "trace": result.trace}
            write_text(failure, json.dumps(entries, indent=1) + "\n")
            return
        if isinstance(kept, PlannedRun) and result.clock is not None:
            made = {"versions": package_versions(), "commit": source_commit()}
            write_text(self.made_path(kept), json.dumps({**result.clock._asdict(), **made}) + "\n")
        path = self.run_path(kept) if isinstance(kept, PlannedRun) else self.bounds_path(kept)
        write_atomically(path, lambda file: file.write(result.content))
        failure.unlink(missing_ok=True)

    def load(self, run: PlannedRun) -> TrainedRun | None:
        """Read a finished training; None if it is not finished, or its file is damaged."""
        path = self.run_path(run)
        with suppress(InvalidInputError):
            if path.exists():
                return load_run(path, run)
        return None

    def shorter_runs(
        self, lineages: Collection[str]
    ) -> dict[str, list[tuple[PlannedRun, WholeRun]]]:
        """Finished trainings, whichever study they were for, that differ in iterations alone.

        Parameters
        ----------
        lineages : collection of str
            Hashes of settings without the number of iterations.

        Returns
        -------
        dict
            By these hashes, the trainings whose state is kept.
        """
        found: dict[str, list[tuple[PlannedRun, WholeRun]]] = {}
        for path in sorted((self.folder / "runs").glob("*.npz")):
            with suppress(KinarmError):
                planned = planned_run(path)
                if planned.lineage in lineages and planned.key == path.stem:
                    found.setdefault(planned.lineage, []).append(
                        (planned, load_whole_run(path, planned))
                    )
        return found

    def made(self, run: PlannedRun) -> dict[str, Any]:
        """How a training was made: times [s], versions and commit; empty if unknown."""
        path = self.made_path(run)
        with suppress(KinarmError), reading(repr(str(path)), "record", KinarmError):
            entries = load_json(path, "record", KinarmError)
            RunClock(*(entries[name] for name in RunClock._fields))
            return dict(entries)
        return {}

    def failure(self, task: PlannedRun | BoundTask) -> str | None:
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
