"""Numbers that several threads take from one counter."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numba import njit

from kinarm.kernels.session import take_number


@njit(nogil=True)
def take_many(counter, taken):
    for i in range(taken.shape[0]):
        taken[i] = take_number(counter)


def test_threads_get_different_numbers():
    counter, taken = np.zeros(1, dtype=np.int64), np.empty((4, 100_000), dtype=np.int64)
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda row: take_many(counter, row), taken))
    np.testing.assert_array_equal(np.sort(taken, axis=None), np.arange(taken.size))
    assert counter[0] == taken.size
