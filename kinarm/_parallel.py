"""Threads: kernels over the rows of a batch on several, and torch on one."""

import os
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from threading import current_thread, main_thread
from typing import Any

import numpy as np

PARALLEL_STEPS = 8192
BALANCED_STEPS = 16384
SHARED_STEPS = 2048

LONG_STEPS = 5_000_000
"""Work of some seconds, at most, that the calling thread does without hearing of Ctrl-C."""

NO_MORE = 2**56
"""Number of a row that no batch has, nor rows of which it is the number of a group of lanes."""


def available_threads() -> int:
    """Processors that this process may use; where the system does not say, all that there are."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def run_rows(
    kernel: Callable[..., int | None], n: int, work: int, threads: int, *arrays: Any
) -> int:
    """Call ``kernel(first, last, *arrays)`` for ranges that cover n rows; add up the results.

    Neither threads, at most so many, nor ranges change results. Kernels release the GIL. By the
    estimated work [episode steps], the calling thread does little alone.
    """
    if threads == 1 or n == 0 or work < PARALLEL_STEPS:
        return kernel(0, n, *arrays) or 0
    ranges_each = 1 if work < BALANCED_STEPS else 4
    size = -(-n // (ranges_each * threads))
    pool = thread_pool(os.getpid(), threads)
    ranges = [
        pool.submit(kernel, first, min(first + size, n), *arrays) for first in range(0, n, size)
    ]
    return sum(done.result() or 0 for done in ranges)


def run_together(
    kernel: Callable[..., int], work: int, threads: int, given: Callable[[int], Any], *arrays: Any
) -> int:
    """Call ``kernel(counter, given(thread), *arrays)`` on several threads; add up the results.

    By a counter, zero at first, kernels share the rows as long as there are any. The calling thread
    is number 0. If it hears of interruptions, it waits where the work is long (see `run_rows`), and
    they end it after the rows under way. A thread that comes too late is not awaited.
    """
    counter = np.zeros(1, dtype=np.int64)
    waits = work > LONG_STEPS and current_thread() is main_thread()
    if work < SHARED_STEPS or (threads == 1 and not waits):
        return kernel(counter, given(0), *arrays)
    pool = thread_pool(os.getpid(), threads)
    helpers = [
        pool.submit(kernel, counter, given(thread), *arrays)
        for thread in range(0 if waits else 1, threads)
    ]
    try:
        total = helpers.pop(0).result() if waits else kernel(counter, given(0), *arrays)
        return total + sum(helper.result() for helper in helpers if not helper.cancel())
    except BaseException:
        counter[0] = NO_MORE
        raise


@cache
def thread_pool(process: int, threads: int) -> ThreadPoolExecutor:
    """A pool per process, since a fork loses threads."""
    return ThreadPoolExecutor(threads, thread_name_prefix=f"kinarm-{process}")


@contextmanager
def one_torch_thread() -> Iterator[None]:
    """Keep torch, if it is loaded, to one thread.

    Several are slower for small networks, and their sums depend on their number.
    """
    torch = sys.modules.get("torch")
    if torch is None:
        yield
        return
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)
