"""Worker processes of this machine."""

import os
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

from kinarm._interrupts import kept_from_children
from kinarm.errors import WorkerError

TaskT = TypeVar("TaskT")
ResultT = TypeVar("ResultT")

WATCH_SECONDS = 0.2
"""How often a worker looks whether its parent is still there."""

ATTEMPTS = 3
"""How often workers may end unexpectedly before another task is finished."""

REPLACED = "A worker stopped while some jobs were given to the executor"
"""How Loky's warning begins of a worker that it replaces because its memory has grown.

Kernels and libraries that a task loads are no leak. The warning comes from the thread that manages
the workers: as an error, it would end that thread, and nothing would go on.
"""

LOST_WORKERS = "workers ended unexpectedly, perhaps for want of memory"


class Finished(NamedTuple, Generic[ResultT]):
    """A task that is done.

    Attributes
    ----------
    number : int
        Which of the tasks, from 0.
    result : object
        What the work returned for it.
    """

    number: int
    result: ResultT


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

    def carry_out(
        self, work: Callable[[TaskT], ResultT], tasks: Sequence[TaskT]
    ) -> Iterator[Finished[ResultT]]:
        """Do the work for every task, begun in the given order; yield what finishes.

        What workers that ended unexpectedly had begun is done again. Abandoned or interrupted,
        what is not finished is dropped.

        Raises
        ------
        WorkerError
            If workers end unexpectedly three times before another task is finished.
        """
        waiting, failures = dict(enumerate(tasks)), 0
        while waiting:
            try:
                for finished in self._attempt(work, waiting):
                    failures = 0
                    del waiting[finished.number]
                    yield finished
            except BrokenProcessPool as error:
                failures += 1
                if failures == ATTEMPTS:
                    raise WorkerError(
                        f"{LOST_WORKERS}; the same command goes on with what is missing"
                    ) from error

    def _attempt(
        self, work: Callable[[TaskT], ResultT], waiting: dict[int, TaskT]
    ) -> Iterator[Finished[ResultT]]:
        """Do the work for the tasks that wait, until a worker is lost."""
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
        warnings.filterwarnings("ignore", REPLACED, UserWarning)
        resource_tracker.ensure_running()  # where it begins, it lets signals through again
        with kept_from_children():
            done = parallel(delayed(_done)(work, *item) for item in list(waiting.items()))
        with _closed_in_silence(done):
            for finished in done:  # noqa: UP028 - `yield from` would close it first
                yield finished


@contextmanager
def _closed_in_silence(done: Generator[ResultT, None, None]) -> Iterator[None]:
    """Joblib warns of the tasks that are dropped where it is not asked for all."""
    try:
        yield
    finally:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            done.close()


def _done(work: Callable[[TaskT], ResultT], number: int, task: TaskT) -> Finished[ResultT]:
    return Finished(number, work(task))


def _prepare_worker(parent: int) -> None:
    """End when the parent does."""
    threading.Thread(target=_end_with_parent, args=(parent,), daemon=True).start()


def _end_with_parent(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(WATCH_SECONDS)
    os._exit(1)
