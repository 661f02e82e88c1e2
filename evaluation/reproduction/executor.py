"""Carry out tasks in worker processes, or wherever an executor puts them."""

import os
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol, TypeVar

from kinarm._interrupts import kept_from_children
from kinarm.errors import WorkerError

TaskT = TypeVar("TaskT")
WATCH_SECONDS = 0.2
"""How often a worker looks whether its parent is still there."""


class Executor(Protocol):
    """Where tasks are carried out: on this machine, on a cluster, ..."""

    def carry_out(self, work: Callable[[TaskT], object], tasks: Iterable[TaskT]) -> Iterator[TaskT]:
        """Do the work for every task, begun in the given order; yield tasks as they finish.

        Raises
        ------
        WorkerError
            If a worker ends unexpectedly.
        """


@dataclass(frozen=True)
class LocalExecutor:
    """Worker processes of this machine, which end with this process however that ends.

    Parameters
    ----------
    jobs : int
        Tasks at a time; a single one is carried out by this process.
    threads : int
        Threads of a worker.
    """

    jobs: int
    threads: int = 1

    def carry_out(self, work: Callable[[TaskT], object], tasks: Iterable[TaskT]) -> Iterator[TaskT]:
        """Do the work for every task, begun in the given order; yield tasks as they finish.

        Abandoned or interrupted, it leaves what is finished and drops what is not.

        Raises
        ------
        WorkerError
            If a worker ends unexpectedly.
        """
        from multiprocessing import resource_tracker

        from joblib import Parallel, delayed, parallel_config

        with parallel_config(
            "loky",
            n_jobs=self.jobs,
            inner_max_num_threads=self.threads,
            initializer=_prepare_worker,
            initargs=(os.getpid(),),
        ):
            parallel = Parallel(return_as="generator_unordered", batch_size=1, max_nbytes=None)
        try:
            resource_tracker.ensure_running()  # where it begins, it lets signals through again
            with kept_from_children():
                finished = parallel(delayed(_done)(work, task) for task in tasks)
            with _closed_in_silence(finished):
                for task in finished:  # noqa: UP028 - `yield from` would close it first
                    yield task
        except BrokenProcessPool as error:
            raise WorkerError(
                "a worker ended unexpectedly, perhaps for want of memory; "
                "the same command goes on with what is missing"
            ) from error


@contextmanager
def _closed_in_silence(finished: Generator[TaskT, None, None]) -> Iterator[None]:
    """Joblib warns of the tasks that are dropped where it is not asked for all."""
    try:
        yield
    finally:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            finished.close()


def _done(work: Callable[[TaskT], object], task: TaskT) -> TaskT:
    """Do the work for a task, and return the task."""
    work(task)
    return task


def _prepare_worker(parent: int) -> None:
    """End when the parent does."""
    threading.Thread(target=_end_with_parent, args=(parent,), daemon=True).start()


def _end_with_parent(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(WATCH_SECONDS)
    os._exit(1)
