"""Rates of several things by turns, so that other work of the machine slows all of them."""

import statistics
import time
from collections.abc import Callable, Mapping


def alternated(
    runs: Mapping[str, Callable[[], int]], repetitions: int
) -> dict[str, dict[str, float]]:
    """Time several things by turns, and find the median and the best rate of each [1/s].

    Each returns how many steps it took, and its first run is not counted.
    """
    for run in runs.values():
        run()
    rates: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(repetitions):
        for name, run in runs.items():
            began = time.perf_counter()
            steps = run()
            rates[name].append(steps / (time.perf_counter() - began))
    return {
        name: {"median": statistics.median(each), "best": max(each)} for name, each in rates.items()
    }
