"""The folder of an experiment."""

import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomli_w

from kinarm._fields import from_plain, to_plain
from kinarm._files import check_folder, is_being_written, only_writer, write_atomically, write_text
from kinarm.errors import InvalidInputError, KinarmError, PolicyFileError
from kinarm.evaluation.experiments.curve import CurveSoFar, Made
from kinarm.evaluation.experiments.executors import Failure
from kinarm.evaluation.experiments.experiment import Experiment
from kinarm.evaluation.experiments.plan import Run
from kinarm.evaluation.experiments.runs import TaskResult, TrainedRun, load_run
from kinarm.policies.checkpoint import Progress, load_beside, load_checkpoint, load_progress
from kinarm.policies.provenance import package_versions, source_commit

SPECIFICATION = "study.toml"
"""File of the experiment in its folder."""

FOLDERS = ("runs", "made", "failed", "checkpoints")


@dataclass(frozen=True)
class Store:
    """The folder of an experiment and its results.

    Every finished training is one file under the hash of its settings, ``runs/KEY.npz``; what has
    none is still to be done. How long it took, which differs between machines, is in
    ``made/KEY.json``; why it failed, until it succeeds, in ``failed/KEY.json``; and how far it is,
    in ``checkpoints/KEY.npz``. A damaged file counts as missing.
    """

    folder: Path

    def path(self, kind: str, run: Run) -> Path:
        """File of a training in one of the folders."""
        suffix = ".json" if kind in ("made", "failed") else ".npz"
        return self.folder / kind / f"{run.key}{suffix}"

    @contextmanager
    def writing(self, experiment: Experiment) -> Iterator[None]:
        """Claim the folder for an experiment and keep other writers out.

        Raises InvalidInputError if it is the folder of another experiment, and OutputError if it
        cannot be written to, or another process writes to it.
        """
        check_folder(self.folder)
        with only_writer(self.folder):
            self.check(experiment)
            for kind in FOLDERS:
                check_folder(self.folder / kind)
            write_text(self.folder / SPECIFICATION, tomli_w.dumps(experiment.to_json()))
            yield

    def check(self, experiment: Experiment) -> None:
        """Refuse the folder of another experiment."""
        marker = self.folder / SPECIFICATION
        if marker.exists() and (there := Experiment.load(marker).name) != experiment.name:
            raise InvalidInputError(
                f"{str(self.folder)!r} is of the experiment {there!r}, not of "
                f"{experiment.name!r}: name another --out, or delete this folder"
            )

    def save(self, run: Run, result: TaskResult | Failure) -> None:
        """Keep the result of a training, or why it failed."""
        failure = self.path("failed", run)
        if isinstance(result, Failure):
            entries = {"name": run.name, **result._asdict()}
            write_text(failure, json.dumps(entries, indent=1) + "\n")
            return
        made = Made(**vars(result.clock), versions=package_versions(), commit=source_commit())
        write_text(self.path("made", run), json.dumps(to_plain(made)) + "\n")
        write_atomically(self.path("runs", run), lambda file: file.write(result.content))
        failure.unlink(missing_ok=True)

    def clear(self, runs: Iterable[Run]) -> None:
        """Remove trainings, and the folder if nothing else lies there; not one that goes on."""
        goes_on = any(self.path("checkpoints", run).exists() for run in runs)
        if goes_on or is_being_written(self.folder):
            return
        with suppress(OSError):
            for kind in FOLDERS:
                for run in runs:
                    self.path(kind, run).unlink(missing_ok=True)
                (self.folder / kind).rmdir()
            (self.folder / SPECIFICATION).unlink()
            self.folder.rmdir()

    def load(self, runs: Iterable[Run]) -> dict[Run, TrainedRun]:
        """Read the trainings that are finished."""
        found = {}
        for run in runs:
            with suppress(InvalidInputError):
                found[run] = load_run(self.path("runs", run), run, self.made(run))
        return found

    def start(self, run: Run) -> tuple[Any, CurveSoFar]:
        """State and curve with which an interrupted training goes on; None for the beginning."""
        path = self.path("checkpoints", run)
        with suppress(KinarmError):
            return load_checkpoint(path).state, load_beside(path, CurveSoFar)
        return None, CurveSoFar()

    def progress(self, runs: Iterable[Run]) -> list[Progress]:
        """How far trainings under way are, by their checkpoints."""
        keys, found = {run.key for run in runs}, []
        for path in self.folder.glob("checkpoints/*.npz"):
            if path.stem in keys:
                with suppress(PolicyFileError):
                    found.append(load_progress(path))
        return found

    def made(self, run: Run) -> Made:
        """How a training was made; empty if unknown."""
        with suppress(InvalidInputError):
            return from_plain(Made, self._record("made", run), "record")
        return Made()

    def failure(self, run: Run) -> str | None:
        """Why a training failed, in a line; None if it did not."""
        return self._record("failed", run).get("error")

    def _record(self, kind: str, run: Run) -> dict[str, Any]:
        with suppress(OSError, ValueError, RecursionError):
            record = json.loads(self.path(kind, run).read_bytes())
            return record if isinstance(record, dict) else {}
        return {}
