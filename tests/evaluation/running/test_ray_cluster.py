"""Ray as executor, on this machine; for a cluster, see the studies."""

from functools import partial
from pathlib import Path

import pytest
import small_tasks
from small_tasks import kill_own_process_once, square

from kinarm.errors import InvalidInputError, WorkerError
from kinarm.evaluation.running import identity as identities
from kinarm.evaluation.running.ray_cluster import RayExecutor

ray = pytest.importorskip("ray")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore"),  # Ray's own
]

NOBODY = "127.0.0.1:9"
"""An address that nothing listens at."""


@pytest.fixture(autouse=True)
def _surroundings(monkeypatch):
    """Workers find the tasks of these tests."""
    monkeypatch.setenv("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    monkeypatch.setenv("PYTHONPATH", str(Path(small_tasks.__file__).parent))
    yield
    ray.shutdown()


def test_local_is_a_ray_of_its_own_beside_a_cluster(monkeypatch):
    monkeypatch.setenv("RAY_ADDRESS", NOBODY)  # what init() without an address would join
    done = dict(RayExecutor("local", jobs=2).carry_out(square, range(40)))
    assert done == {number: number * number for number in range(40)}
    assert not ray.is_initialized()


def test_lost_workers_are_replaced(tmp_path):
    work = partial(kill_own_process_once, tmp_path)
    done = dict(RayExecutor("local", jobs=2).carry_out(work, range(4)))
    assert done == {number: number for number in range(4)}


def test_errors_of_a_task_are_told_as_they_are():
    with pytest.raises(ZeroDivisionError):
        list(RayExecutor("local", jobs=1).carry_out(partial(divmod, 1), [0]))


def test_a_worker_that_differs_is_refused(monkeypatch):
    others = (*identities.identity(), ("coal", "0.0.1"))
    monkeypatch.setattr("kinarm.evaluation.running.ray_cluster.identity", lambda: others)
    with pytest.raises(WorkerError, match=r"differs from this process: coal is .* there, 0\.0\.1"):
        list(RayExecutor("local", jobs=1).carry_out(square, [1]))


@pytest.mark.parametrize("address", [NOBODY, f"ray://{NOBODY}", "nowhere", "auto"])
def test_no_cluster(address, monkeypatch):
    monkeypatch.setenv("RAY_ADDRESS", NOBODY)  # auto would find one that other tests began
    with pytest.raises(InvalidInputError, match="no Ray cluster answers at"):
        list(RayExecutor(address).carry_out(square, [1]))
