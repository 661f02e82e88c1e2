"""Parts of a piece of work, shared between threads."""

import threading
import time

import numpy as np
import pytest

from kinarm.policies.ppo.update import run_parts


@pytest.mark.parametrize("threads", [1, 2, 3, 20])
def test_every_part_is_done_once(threads):
    done, workers = np.zeros(8, dtype=int), set()

    def kernel(first, last, counts):
        counts[first:last] += 1
        workers.add(threading.get_ident())

    for _ in range(50):
        run_parts(kernel, 8, threads, done)
    assert (done == 50).all()
    assert 1 <= len(workers) <= threads
    assert threading.get_ident() in workers


def test_what_a_helper_raises_is_raised():
    caller = threading.get_ident()

    def kernel(first, last):
        if threading.get_ident() != caller:
            raise ArithmeticError(f"{first} to {last}")
        time.sleep(0.05)

    with pytest.raises(ArithmeticError):
        run_parts(kernel, 8, 2)
