"""Sharing parts of a short piece of work between threads."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any


def share(kernel: Callable[..., None], n_parts: int, threads: int, *arrays: Any) -> None:
    """Call ``kernel(part, part + 1, *arrays)`` for every part, on several threads.

    The calling thread works, too, and never waits for one that has not begun: where processors
    are busy with something else, it does all by itself. Kernels release the GIL and treat parts
    independently, so the result does not depend on who did what.
    """
    parts = iter(range(n_parts))  # whose next number only one thread gets: it holds the GIL

    def work() -> None:
        for part in parts:
            kernel(part, part + 1, *arrays)

    helpers = min(threads, n_parts) - 1
    if helpers == 0:
        kernel(0, n_parts, *arrays)
        return
    pool = _helpers(os.getpid(), helpers)
    helping = [pool.submit(work) for _ in range(helpers)]
    work()
    for helper in helping:
        if not helper.cancel():
            helper.result()


@cache
def _helpers(process: int, count: int) -> ThreadPoolExecutor:
    """A pool per process, since threads do not survive a fork."""
    return ThreadPoolExecutor(count, thread_name_prefix=f"kinarm-ppo-{process}")
