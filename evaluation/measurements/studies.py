"""What a study costs beside its trainings."""

import tempfile
import time
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from kinarm.evaluation.studies.planning import planned_runs
from kinarm.evaluation.studies.runs import RunClock
from kinarm.evaluation.studies.study import Study
from kinarm.evaluation.studies.training import RunTask, TaskResult

TABLE_1: dict[str, Any] = {
    "name": "table 1",
    "seeds": 200,
    "trials": {"count": 200, "per_decade": 0},
}
"""200 trainings with the paper's settings."""

PPO: dict[str, Any] = {
    "name": "ppo",
    "learner": "ppo",
    "recipe": "tuned",
    "seeds": 4,
    "trials": {"count": 200, "per_decade": 0},
    "fixed": {"iterations": 300},
}
"""Four trainings, each half as long as the recipe's."""

SHORT: dict[str, Any] = {
    "name": "short",
    "seeds": 1000,
    "trials": {"count": 200, "per_decade": 0},
    "fixed": {"iterations": 1, "directions": 2, "top_directions": 1},
}
"""A thousand trainings that take no time, to see what reading them takes."""

PLANNED, KEPT = 5000, 200
"""Trainings by which planning and keeping are timed."""

FEW = 24
"""Trainings of Table 1 by which one and two processes are compared."""


def measure_studies() -> dict[str, Any]:
    """Times of studies by one and by two processes, and what the runner adds.

    Returns
    -------
    dict
        ``table_1_seconds`` and ``trainings`` of the study of Table 1 by two processes;
        ``speed_up`` of two processes over one, by learner; ``overhead``, the share of a study by
        one process that is no training; ``load_seconds`` of ``loaded`` finished trainings, and
        ``bytes_each`` of them; ``planned_per_second`` trainings, and ``kept_per_second``.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        few = {**TABLE_1, "seeds": FEW}
        _timed(few, folder / "warm", jobs=2)  # loads and compiles
        one, study = _timed(few, folder / "one", jobs=1)
        spent = sum(study.store.made(run)["processor_seconds"] for run in study.runs)
        two, _ = _timed(few, folder / "two", jobs=2)
        whole, _ = _timed(TABLE_1, folder / "table", jobs=2)
        speed_up = {"ars": one / two}
        if find_spec("torch") is not None:
            _timed({**PPO, "seeds": 2, "fixed": {"iterations": 2}}, folder / "warm-ppo", jobs=2)
            ppo = [_timed(PPO, folder / f"ppo{jobs}", jobs=jobs)[0] for jobs in (1, 2)]
            speed_up["ppo"] = ppo[0] / ppo[1]
        _, short = _timed(SHORT, folder / "short", jobs=2)
        began = time.perf_counter()
        loaded = len(Study.load(short.store.folder).table())
        seconds = time.perf_counter() - began
        sizes = [short.store.run_path(run).stat().st_size for run in short.runs]
        began = time.perf_counter()
        planned = planned_runs(replace(short.specification, seeds=PLANNED))
        keys = {run.key for run in planned}
        planning = time.perf_counter() - began
        return {
            "trainings": TABLE_1["seeds"],
            "table_1_seconds": whole,
            "speed_up": speed_up,
            "overhead": 1 - spent / one,
            "loaded": loaded,
            "load_seconds": seconds,
            "bytes_each": sum(sizes) / len(sizes),
            "planned_per_second": len(keys) / planning,
            "kept_per_second": _kept_per_second(short),
        }


def _kept_per_second(study: Study) -> float:
    """How many finished trainings the driver writes to its folder a second."""
    run, store = study.runs[0], study.store
    result = TaskResult(store.run_path(run).read_bytes(), RunClock())
    began = time.perf_counter()
    for _ in range(KEPT):
        store.save(RunTask(run), result)
    return KEPT / (time.perf_counter() - began)


def _timed(specification: dict[str, Any], folder: Path, jobs: int) -> tuple[float, Study]:
    """Carry out a study, and tell how long that took [s]."""
    study = Study({**specification, "name": folder.name}, folder)
    began = time.perf_counter()
    study.run(jobs=jobs)
    return time.perf_counter() - began, study
