"""Kernels over ranges of rows."""

import threading

import numpy as np
import pytest

from kinarm._parallel import available_threads, run_rows


@pytest.mark.parametrize("n", [1, 2, 7, 255, 256, 1000])
@pytest.mark.parametrize("threads", [1, 2, 3, 8])
@pytest.mark.parametrize("work", [1, 10**6])
def test_every_row_is_worked_on_once(n, threads, work):
    counts = np.zeros(n, dtype=int)

    def kernel(first, last, rows):
        rows[first:last] += 1

    run_rows(kernel, n, work, threads, counts)
    np.testing.assert_array_equal(counts, 1)


def test_no_rows():
    run_rows(lambda first, last: None, 0, 0, 2)


def test_little_work_stays_in_the_calling_thread():
    names = []
    run_rows(lambda first, last: names.append(threading.current_thread()), 10, 10, 4)
    assert names == [threading.current_thread()]


def test_failure_of_a_thread_reaches_the_caller():
    def fail(first, last):
        raise RuntimeError(f"rows {first} to {last}")

    with pytest.raises(RuntimeError, match="rows 0 to"):
        run_rows(fail, 100, 10**6, 2)


def test_at_least_one_thread():
    assert available_threads() >= 1
