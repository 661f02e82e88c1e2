"""Readers of what lies in the folder of a study."""

from copy import copy
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from kinarm.evaluation.experiments.experiment import Experiment
from kinarm.evaluation.experiments.runs import load_bounds, load_run, run_of_file
from kinarm.evaluation.experiments.store import Store
from kinarm.evaluation.experiments.study import Study
from kinarm.evaluation.studies.transfer.planning import Protocol
from kinarm.evaluation.studies.transfer.runs import load_run as load_transferred
from kinarm.evaluation.studies.transfer.runs import policy_path, save_run
from kinarm.evaluation.studies.transfer.study import TransferStudy
from kinarm.evaluation.studies.transfer.training import carry_out

from .loader import Loader
from .mutations import damaged_archive, damaged_json, damaged_toml

SMALL = {
    "name": "small",
    "trials": {"count": 5},
    "fixed": {"iterations": 1, "directions": 2, "top_directions": 1},
}

FILE = b"""
learner = "ars"
problems = ["right"]
seeds = 2

[trials]
count = 5

[fixed]
iterations = 2
reward.success = 2.0

[grid]
step_size = [0.01, 0.02]
"problem.task.start_spread" = [0.2]

[random]
count = 1
noise = { low = 0.01, high = 0.1, log = true }
sharing = ["none", "pair"]
"""


@cache
def _files() -> dict[str, bytes]:
    """Files of a study whose one training is finished, by their folder."""
    with TemporaryDirectory() as folder:
        study = Study(SMALL, folder).run(jobs=1)
        store, run = study.store, study.runs[0]
        paths = store.run_path(run), store.made_path(run), store.bounds_path(study.bound_tasks[0])
        return {path.parent.name: path.read_bytes() for path in paths}


PLANNED = Study(SMALL, Path())
KEY = PLANNED.runs[0].key


def _study(path: Path) -> Study:
    """A study that knows its trainings, and nothing else yet."""
    study = copy(PLANNED)
    study.store = Store(path.parents[1])
    return study


def _load_run(path: Path) -> None:
    study = _study(path)
    load_run(path, run_of_file(path), whole=True)
    len(study.table())


def _load_made(path: Path) -> None:
    study = _study(path)
    study.store.made(study.runs[0])


def _load_failure(path: Path) -> None:
    study = _study(path)
    study.store.failure(study.runs[0])


def _load_file(path: Path) -> None:
    repr(Study(Experiment.load(path), path.parent))


TRANSFER = TransferStudy(
    learners=("ars",),
    seeds=1,
    settings={"ars": {"iterations": 1, "episodes": 1, "directions": 2, "top_directions": 1}},
    protocol=Protocol(trials=2, looks=2, look_trials=2),
).trainings[0]
"""A training of a study of transfer."""


@cache
def _transfer_files() -> tuple[bytes, bytes]:
    """What is kept of the training, and its policy."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        save_run(folder, TRANSFER, carry_out(TRANSFER, folder))
        kept = folder / f"{TRANSFER.name}.json"
        return kept.read_bytes(), policy_path(folder, TRANSFER).read_bytes()


def _save_transferred(folder: Path) -> None:
    policy_path(folder, TRANSFER).write_bytes(_transfer_files()[1])


LOADERS = {
    "run of a study of transfer": Loader(
        ("evaluation.studies.transfer.runs.load_run",),
        lambda: [_transfer_files()[0]],
        damaged_json,
        lambda path: load_transferred(path.parent, TRANSFER),
        f"{TRANSFER.name}.json",
        _save_transferred,
    ),
    "study": Loader(
        ("evaluation.experiments.experiment.load",),
        lambda: [FILE],
        damaged_toml,
        _load_file,
        "file.toml",
    ),
    "study run": Loader(
        (
            "evaluation.experiments.runs.load_run",
            "evaluation.experiments.runs.run_of_file",
        ),
        lambda: [_files()["runs"]],
        damaged_archive,
        _load_run,
        f"runs/{KEY}.npz",
    ),
    "study bounds": Loader(
        ("evaluation.experiments.runs.load_bounds",),
        lambda: [_files()["bounds"]],
        damaged_archive,
        lambda path: load_bounds(path, 5),
    ),
    "record of a study run": Loader(
        ("evaluation.experiments.store.made",),
        lambda: [_files()["made"]],
        damaged_json,
        _load_made,
        f"made/{KEY}.json",
    ),
    "failure of a study run": Loader(
        ("evaluation.experiments.store.failure",),
        lambda: [b'{"name": "a run", "error": "too much", "trace": ""}'],
        damaged_json,
        _load_failure,
        f"failed/{KEY}.json",
    ),
}
