"""Array jobs, carried out by processes of this machine."""

import importlib.util
from functools import partial
from pathlib import Path

import pytest
import small_tasks
from small_tasks import square, touch

from kinarm.errors import InvalidInputError, WorkerError
from kinarm.evaluation.running import identity as identities
from kinarm.evaluation.running.slurm import Bundle, SlurmExecutor

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("submitit") is None, reason="needs the extra slurm"
)


@pytest.fixture
def executor(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(small_tasks.__file__).parent))
    monkeypatch.setattr("kinarm.evaluation.running.slurm.LOOK_SECONDS", 0.05)
    return partial(SlurmExecutor, tmp_path / "slurm", cluster="local")


@pytest.mark.slow
def test_every_task_is_done_once(executor, tmp_path):
    (tmp_path / "done").mkdir()
    list(executor(bundle=3).carry_out(partial(touch, tmp_path / "done"), range(7)))
    assert sorted(path.name for path in (tmp_path / "done").iterdir()) == [*"0123456"]
    assert len(list((tmp_path / "slurm").glob("*_submitted.pkl"))) == 3


@pytest.mark.slow
def test_results_come_with_the_number_of_their_task(executor):
    done = dict(executor(bundle=2).carry_out(square, [3, 1, 2]))
    assert done == {0: 9, 1: 1, 2: 4}


@pytest.mark.slow
def test_a_job_that_fails(executor, tmp_path):
    work = partial(touch, tmp_path / "missing")
    with pytest.raises(WorkerError, match=r"job .* failed: .*FileNotFoundError.*goes on"):
        list(executor().carry_out(work, range(2)))


@pytest.mark.slow
def test_a_worker_that_differs_is_refused(executor, monkeypatch):
    others = (*identities.identity(), ("coal", "0.0.1"))
    monkeypatch.setattr("kinarm.evaluation.running.slurm.identity", lambda: others)
    with pytest.raises(WorkerError, match="differs from this process: coal is"):
        list(executor().carry_out(square, [1]))


def test_nothing_to_do(executor):
    assert list(executor().carry_out(square, [])) == []


def test_without_slurm(tmp_path):
    with pytest.raises(InvalidInputError, match="Slurm takes no jobs"):
        list(SlurmExecutor(tmp_path / "slurm").carry_out(square, [1]))


def test_what_is_taken_away_goes_on_where_it_was():
    """Slurm interrupts a bundle amid its second task; the rest is what it is to run."""
    seen = []

    def work(task):
        seen.append(task)
        if task == 20 and seen.count(20) == 1:
            raise KeyboardInterrupt
        return task + 1

    bundle = Bundle(work, [(0, 10), (1, 20), (2, 30)])
    with pytest.raises(KeyboardInterrupt):
        bundle()
    rest = bundle.checkpoint()
    assert rest.result() == [(0, 11), (1, 21), (2, 31)]
    assert seen == [10, 20, 20, 30]
