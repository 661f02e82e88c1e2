"""Worker processes: every task once, whatever happens to them."""

import os
import queue
import sys
from functools import partial
from types import SimpleNamespace

import pytest
from small_tasks import (
    kill_own_process_at_seven,
    kill_own_process_once,
    seem_to_leak,
    square,
    touch,
)

from kinarm import workers
from kinarm.errors import WorkerError
from kinarm.workers import ATTEMPTS, LocalExecutor


@pytest.mark.parametrize("jobs", [1, 2])
def test_every_task_is_done_once(jobs, tmp_path):
    done = LocalExecutor(jobs).carry_out(partial(touch, tmp_path), range(6))
    assert sorted(number for number, _ in done) == list(range(6))
    assert sorted(path.name for path in tmp_path.iterdir()) == [*"012345"]


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_come_with_the_number_of_their_task(jobs):
    done = dict(LocalExecutor(jobs).carry_out(square, [3, 1, 2]))
    assert done == {0: 9, 1: 1, 2: 4}


def test_one_at_a_time_they_are_done_in_the_given_order():
    assert [number for number, _ in LocalExecutor(1).carry_out(square, (3, 1, 2))] == [0, 1, 2]


def test_nothing_to_do():
    assert list(LocalExecutor(2).carry_out(square, [])) == []


def test_what_lost_workers_had_begun_is_done_again(tmp_path):
    work = partial(kill_own_process_once, tmp_path)
    assert ATTEMPTS > 2  # tasks 1 and 3 may be lost with no other one finished in between
    done = LocalExecutor(2).carry_out(work, range(4))
    assert sorted(done) == [(number, number) for number in range(4)]


def test_a_task_that_kills_every_worker():
    tasks = LocalExecutor(2).carry_out(kill_own_process_at_seven, range(9))
    with pytest.raises(WorkerError, match="workers ended unexpectedly"):
        list(tasks)


def test_workers_that_grow_are_replaced_in_silence():
    """Loky warns of it in a thread of its own, which an error would end, and nothing go on."""
    done = LocalExecutor(2).carry_out(seem_to_leak, range(8))
    assert sorted(done) == [(number, number) for number in range(8)]


def test_errors_of_a_task_are_told_as_they_are(tmp_path):
    work = partial(touch, tmp_path / "missing")
    with pytest.raises(FileNotFoundError):
        list(LocalExecutor(2).carry_out(work, range(3)))


def test_a_worker_ends_when_its_parent_has_ended(monkeypatch):
    """Linux then gives it another one."""
    parents, waited = iter([17, 17, 1]), []
    monkeypatch.setattr(os, "getppid", lambda: next(parents))
    monkeypatch.setattr(workers, "time", SimpleNamespace(sleep=waited.append))
    monkeypatch.setattr(os, "_exit", sys.exit)
    with pytest.raises(SystemExit) as ended:
        workers._end_with_parent(17)
    assert ended.value.code == 1
    assert waited == [workers.WATCH_SECONDS] * 2


def test_a_worker_looks_after_its_parent_in_a_thread_of_its_own(monkeypatch):
    watched = queue.SimpleQueue()
    monkeypatch.setattr(workers, "_end_with_parent", watched.put)
    workers._prepare_worker(17)
    assert watched.get(timeout=30) == 17
