"""Where tasks run: this process, worker processes, or a cluster."""

import os
import pickle
import queue
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from kinarm._files import first_line
from kinarm._interrupts import kept_from_children
from kinarm.errors import WorkerError
from kinarm.policies.learners import look_here

Work = Callable[[Any], Any]
"""From a task to its result."""


class Failure(NamedTuple):
    """Why a task failed.

    Attributes
    ----------
    error : str
        The reason, in a line.
    trace : str
        Where it happened.
    """

    error: str
    trace: str


class Executor(Protocol):
    """Where tasks run."""

    def map(self, work: Work, tasks: Sequence[Any]) -> Iterator[tuple[Any, Any | Failure]]:
        """Do the work for every task, begun in the given order; yield each task with its result.

        Work, tasks and results can be pickled. What the work raises becomes a
        `Failure`. An abandoned or interrupted executor drops what is not
        finished.

        Raises
        ------
        WorkerError
            If workers end unexpectedly.
        """


def attempt(work: Work, task: bytes) -> Any:
    """Do the work for a pickled task; errors are returned as a `Failure`.

    Its learner may be in a module of the current directory.
    """
    look_here()
    try:
        return work(pickle.loads(task))
    except Exception as error:  # whatever it is, other tasks go on
        return Failure(first_line(error), traceback.format_exc())


WATCHED = 0.2
"""How often a worker looks for its parent [s]."""

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Environment variables for the number of threads of libraries."""


@dataclass(frozen=True)
class LocalExecutor:
    """Worker processes of this machine, which end with this process.

    Parameters
    ----------
    jobs : int
        Tasks at a time; a single one runs in this process.
    threads : int
        Threads of a worker.
    """

    jobs: int
    threads: int = 1

    def map(self, work: Work, tasks: Sequence[Any]) -> Iterator[tuple[Any, Any | Failure]]:
        """Do the work for every task; see `Executor.map`."""
        if min(self.jobs, len(tasks)) <= 1:
            for task in tasks:
                yield task, attempt(work, pickle.dumps(task))
            return
        from concurrent.futures import BrokenExecutor, as_completed
        from multiprocessing import resource_tracker

        from joblib.externals.loky import get_reusable_executor

        # Loky warns that a worker's memory has grown: kernels are no leak.
        warnings.filterwarnings("ignore", "A worker stopped while some jobs", UserWarning)
        resource_tracker.ensure_running()  # where it begins, it lets signals through again
        with kept_from_children():
            pool = get_reusable_executor(
                min(self.jobs, len(tasks)),
                initializer=_end_with,
                initargs=(os.getpid(),),
                env=dict.fromkeys(THREADS, str(self.threads)),
            )
        under_way: dict[Any, Any] = {}
        try:
            with kept_from_children():
                for task in tasks:
                    under_way[pool.submit(attempt, work, pickle.dumps(task))] = task
            for done in as_completed(under_way):
                yield under_way.pop(done), done.result()
        except BrokenExecutor as error:
            raise WorkerError(
                "workers ended unexpectedly, perhaps for want of memory; the same command goes on "
                "with what is missing"
            ) from error
        finally:
            if not all(each.done() for each in under_way):
                with suppress(queue.Empty):  # loky forgets these tasks, then looks them up
                    while True:
                        pool._work_ids.get_nowait()
                pool.shutdown(kill_workers=True)


def _end_with(parent: int) -> None:
    """End this process when its parent does."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(WATCHED)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
