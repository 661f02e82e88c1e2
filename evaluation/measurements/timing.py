"""Rates, as medians over repetitions."""

import statistics
import time
from collections.abc import Callable, Mapping
from typing import NamedTuple


class Timing(NamedTuple):
    """Rates over several repetitions [1/s]."""

    median: float
    best: float


def timed(run: Callable[[], int], repetitions: int) -> Timing:
    """Time something that returns how many steps it took; the first run is not counted."""
    return alternated({"": run}, repetitions)[""]


def alternated(runs: Mapping[str, Callable[[], int]], repetitions: int) -> dict[str, Timing]:
    """Time several things by turns, so that other work of the machine slows all of them.

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
    return {name: Timing(statistics.median(each), max(each)) for name, each in rates.items()}
