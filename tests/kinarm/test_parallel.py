"""Kernels over ranges of rows."""

import os
import signal
import threading
import time

import numpy as np
import pytest

from kinarm._parallel import available_threads, run_rows, run_together
from kinarm.simulator import Simulator


def test_processors_are_those_of_the_process_or_all(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {2, 5}, raising=False)
    assert available_threads() == 2
    monkeypatch.delattr(os, "sched_getaffinity")  # as on macOS
    assert available_threads() == os.cpu_count()
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert available_threads() == 1


@pytest.mark.parametrize("n", [1, 7, 1000])
@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("work", [1, 10**6])
def test_every_row_is_worked_on_once(n, threads, work):
    counts = np.zeros(n, dtype=int)

    def kernel(first, last, rows):
        rows[first:last] += 1

    run_rows(kernel, n, work, threads, counts)
    np.testing.assert_array_equal(counts, 1)


def test_little_work_stays_in_the_calling_thread():
    names = []
    run_rows(lambda first, last: names.append(threading.current_thread()), 10, 10, 4)
    assert names == [threading.current_thread()]


def test_failure_of_a_thread_reaches_the_caller():
    def fail(first, last):
        raise RuntimeError(f"rows {first} to {last}")

    with pytest.raises(RuntimeError, match="rows 0 to"):
        run_rows(fail, 100, 10**6, 2)


class TestTogether:
    @pytest.mark.parametrize(
        ("work", "threads", "at_most"), [(1, 4, 1), (10**6, 1, 1), (10**6, 3, 3)]
    )
    def test_results_of_all_threads_are_added_up(self, work, threads, at_most):
        seen, lock = [], threading.Lock()

        def kernel(counters, rows):
            done = 0
            while True:
                with lock:
                    row, counters[0] = counters[0], counters[0] + 1
                if row >= len(rows):
                    seen.append(threading.current_thread())
                    return done
                rows[row] += 1
                done += 1

        counts = np.zeros(500, dtype=int)
        assert run_together(kernel, work, threads, lambda thread: counts) == 500
        np.testing.assert_array_equal(counts, 1)
        assert threading.current_thread() in seen
        assert len(seen) <= at_most

    @pytest.mark.parametrize("threads", [1, 2])
    def test_an_interruption_ends_long_work_after_the_rows_under_way(self, threads):
        ended = threading.Semaphore(0)
        # A background job inherits that Ctrl-C is ignored.
        handler = signal.signal(signal.SIGINT, signal.default_int_handler)

        def kernel(counters, thread):
            while 8 * counters[0] < 24_000:  # rows of lanes, as kernels count them
                counters[0] += 1
                time.sleep(0.01)
            ended.release()
            return 0

        threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
        try:
            with pytest.raises(KeyboardInterrupt):
                run_together(kernel, 10**9, threads, int)
        finally:
            signal.signal(signal.SIGINT, handler)
        assert all(ended.acquire(timeout=60) for _ in range(threads))

    def test_a_thread_that_comes_too_late_is_not_waited_for(self):
        busy, free = [threading.Event() for _ in range(2)]

        def block(counters, thread):
            busy.set()
            free.wait()
            return 0

        others = threading.Thread(target=run_together, args=(block, 10**6, 5, int))
        others.start()
        busy.wait()
        try:
            assert run_together(lambda counters, thread: 1, 10**6, 5, int) >= 1
        finally:
            free.set()
            others.join()


def test_functions_have_torch_to_one_thread_of_it():
    torch = pytest.importorskip("torch")
    before, seen = torch.get_num_threads(), []
    torch.set_num_threads(3)
    try:
        simulator = Simulator("right")
        starts, goals = simulator.sample(np.random.default_rng(0), 2)

        def policy(observations):
            seen.append(torch.get_num_threads())
            return np.zeros((len(observations), simulator.n_actions))

        simulator.rollout(policy, starts, goals)
        assert (set(seen), torch.get_num_threads()) == ({1}, 3)
    finally:
        torch.set_num_threads(before)
