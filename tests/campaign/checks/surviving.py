"""Calls of a library that may end the process: a child makes them, another goes on behind it."""

import multiprocessing
from collections.abc import Callable
from multiprocessing.sharedctypes import RawArray

import numpy as np
from numpy.typing import NDArray

FORK = multiprocessing.get_context("fork")


def surviving(call: Callable[[int], float], count: int) -> NDArray[np.float64]:
    """What a call gives for each number below a count; NaN where it ends the process.

    Raises
    ------
    RuntimeError
        If a call fails in another way.
    """
    results = np.frombuffer(RawArray("d", max(1, count)))[:count]
    results[:] = np.nan
    begun = np.frombuffer(RawArray("q", 1), dtype=np.int64)
    begun[0] = -1
    while begun[0] + 1 < count:
        child = FORK.Process(target=_work, args=(call, count, results, begun))
        child.start()
        child.join()
        if child.exitcode is not None and child.exitcode > 0:
            raise RuntimeError(f"a call ended with status {child.exitcode}")
    return np.array(results)


def _work(
    call: Callable[[int], float],
    count: int,
    results: NDArray[np.float64],
    begun: NDArray[np.int64],
) -> None:
    """Make the calls behind the last one that was begun."""
    for number in range(int(begun[0]) + 1, count):
        begun[0] = number
        results[number] = call(number)
