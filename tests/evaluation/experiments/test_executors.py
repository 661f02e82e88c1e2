"""Executors: every task once, whatever happens to the workers, on this machine and on clusters."""

from functools import partial
from importlib.util import find_spec
from pathlib import Path

import pytest
import small_tasks
from small_tasks import kill_own_process_once, square, touch

from kinarm.errors import InvalidInputError, WorkerError
from kinarm.evaluation.commands.study import RunningOptions, StudyRequest
from kinarm.evaluation.experiments import executors
from kinarm.evaluation.experiments.executors import (
    Failure,
    LocalExecutor,
    RayExecutor,
    SlurmExecutor,
    _do_alike,
)

NOBODY = "127.0.0.1:9"
"""An address that nothing listens at."""

needs_slurm = pytest.mark.skipif(find_spec("submitit") is None, reason="needs the extra slurm")
needs_ray = pytest.mark.skipif(find_spec("ray") is None, reason="needs the extra ray")


@pytest.fixture(autouse=True)
def _surroundings(monkeypatch):
    """Workers find the tasks of these tests."""
    monkeypatch.setenv("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    monkeypatch.setenv("PYTHONPATH", str(Path(small_tasks.__file__).parent))
    monkeypatch.setattr(executors, "LOOK_SECONDS", 0.05)


@pytest.fixture(
    params=[
        "one process",
        "two processes",
        pytest.param("slurm", marks=[needs_slurm, pytest.mark.slow]),
    ]
)
def executor(request, tmp_path):
    """Each executor in turn."""
    return {
        "one process": LocalExecutor(1),
        "two processes": LocalExecutor(2),
        "slurm": SlurmExecutor(tmp_path / "slurm", bundle=3, cluster="local"),
    }[request.param]


def test_every_task_is_done_once_and_what_it_raises_is_its_result(executor, tmp_path):
    (tmp_path / "done").mkdir()
    found = dict(executor.map(partial(touch, tmp_path / "done"), [*range(7), "no/where"]))
    failure = found.pop("no/where")
    assert isinstance(failure, Failure)
    assert "FileNotFoundError" in failure.trace
    assert found == dict.fromkeys(range(7))
    assert sorted(path.name for path in (tmp_path / "done").iterdir()) == [*"0123456"]


def test_nothing_to_do(executor):
    assert list(executor.map(square, [])) == []


def test_work_of_another_kinarm_is_refused():
    work = partial(_do_alike, square, {**executors.identity(), "coal": "0.0.1"})
    ((_, failure),) = LocalExecutor(1).map(work, [1])
    assert failure.error.startswith("a worker differs from this process: coal is ")
    assert failure.error.endswith(" there, 0.0.1 here")


def test_workers_agree_on_packages_results_and_commits_that_are_known(monkeypatch):
    here = executors.identity()
    assert {"python", "numpy", "numba", "coal", "pin", "semantics", "oracle semantics"} <= set(here)
    monkeypatch.setattr(executors, "source_commit", lambda: "0123abcd")
    assert _do_alike(square, {**here, "commit of kinarm": ""}, 3) == 9
    with pytest.raises(WorkerError, match="commit of kinarm is 0123abcd there, 4567 here"):
        _do_alike(square, {**here, "commit of kinarm": "4567"}, 3)


def test_one_at_a_time_tasks_are_done_in_the_given_order():
    assert list(LocalExecutor(1).map(square, (3, 1, 2))) == [(3, 9), (1, 1), (2, 4)]


@needs_ray
@pytest.mark.rare
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_does_again_what_lost_workers_had_begun(tmp_path):
    work = partial(kill_own_process_once, tmp_path)
    found = dict(RayExecutor("local", 2).map(work, [0, 1, 2, 3, "no number"]))
    assert "TypeError" in found.pop("no number").trace
    assert found == {number: number for number in range(4)}


def test_a_lost_worker(tmp_path):
    """The next workers are new ones."""
    with pytest.raises(WorkerError, match="workers ended unexpectedly"):
        list(LocalExecutor(2).map(partial(kill_own_process_once, tmp_path), range(4)))
    assert sorted(LocalExecutor(2).map(square, range(3))) == [(0, 0), (1, 1), (2, 4)]


@needs_ray
@pytest.mark.parametrize("address", [NOBODY, f"ray://{NOBODY}", "nowhere", "auto"])
def test_no_cluster(address, monkeypatch):
    monkeypatch.setenv("RAY_ADDRESS", NOBODY)  # auto would find one that other tests began
    with pytest.raises(InvalidInputError, match="no Ray cluster answers at"):
        list(RayExecutor(address).map(square, [1]))


@needs_slurm
def test_without_slurm(tmp_path):
    with pytest.raises(InvalidInputError, match="Slurm takes no jobs"):
        list(SlurmExecutor(tmp_path / "slurm").map(square, [1]))


class TestOptions:
    @pytest.mark.parametrize(
        ("given", "words"),
        [
            ({"jobs": 0}, "jobs must be a whole number of at least 1"),
            ({"ray": "auto", "slurm": True}, "--ray and --slurm exclude each other"),
            ({"jobs": 2, "slurm": True}, "--jobs is for this machine"),
        ],
    )
    def test_refused(self, given, words):
        with pytest.raises(InvalidInputError, match=words):
            RunningOptions(**given)

    @pytest.mark.parametrize("given", [{"jobs": 2}, {"ray": "auto"}, {"slurm": True}])
    def test_without_training_nothing_runs_anywhere(self, given):
        with pytest.raises(InvalidInputError, match="does not go with --no-train"):
            StudyRequest(experiment=Path("it"), train=False, **given)

    @pytest.mark.parametrize(
        ("given", "made"),
        [
            ({"jobs": 3}, LocalExecutor(3, 2)),
            ({"ray": "auto", "jobs": 3}, RayExecutor("auto", 3, 2)),
            ({"slurm": True, "minutes": 9}, SlurmExecutor(Path("out/slurm"), 1, 9, 2)),
        ],
    )
    def test_the_executor(self, given, made):
        assert RunningOptions(**given).executor(Path("out"), threads=2) == made
