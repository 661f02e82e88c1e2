"""Where tasks are carried out: in this process, in worker processes, or on a cluster."""

import hashlib
import os
import pickle
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar

import kinarm
from kinarm import SEMANTICS
from kinarm._files import first_line
from kinarm._interrupts import kept_from_children
from kinarm.errors import WorkerError
from kinarm.policies.oracle import ORACLE_SEMANTICS
from kinarm.policies.provenance import package_versions

TaskT = TypeVar("TaskT")
ResultT = TypeVar("ResultT")


class Failure(NamedTuple):
    """Why a task came to nothing.

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
    """Where tasks are carried out."""

    @property
    def shares_files(self) -> bool:
        """Whether workers write to the same files as this process."""

    def map(
        self, work: Callable[[TaskT], ResultT], tasks: Sequence[TaskT]
    ) -> Iterator[tuple[TaskT, ResultT | Failure]]:
        """Do the work for every task, begun in the given order; yield what finishes.

        Work, tasks and results can be pickled. What the work raises is the result of its task, as a
        `Failure`. The work may be done more than once for a task whose worker was lost; a result is
        yielded once. Abandoned or interrupted, an executor drops what is not finished.

        Parameters
        ----------
        work : callable
            What to do.
        tasks : sequence
            What it takes.

        Raises
        ------
        WorkerError
            If workers end unexpectedly, again and again, or differ from this process.
        """


@dataclass(frozen=True)
class Work:
    """Work as it travels to workers, where it takes pickled tasks.

    Attributes
    ----------
    do : callable
        What to do.
    identity : tuple
        What `identity` told the process that it was made in.
    """

    do: Callable[[Any], Any]
    identity: tuple[tuple[str, str], ...]

    @classmethod
    def of(cls, do: Callable[[Any], Any]) -> "Work":
        """Work that only workers do that equal this process."""
        return cls(do, identity())

    def __call__(self, task: bytes) -> Any:
        """Do the work for a task; what goes wrong is returned as a `Failure`.

        Raises
        ------
        WorkerError
            If this worker differs from the process that the work was made in.
        """
        check_identity(self.identity)
        try:
            return self.do(pickle.loads(task))
        except Exception as error:  # whatever it is, other tasks go on
            return Failure(first_line(error), traceback.format_exc())


@cache
def identity() -> tuple[tuple[str, str], ...]:
    """Versions of packages, of results, and the hash of kinarm's source, by name."""
    versions = {
        **package_versions(),
        "semantics": SEMANTICS,
        "oracle semantics": ORACLE_SEMANTICS,
        "source of kinarm": source_digest(),
    }
    return tuple(versions.items())


def source_digest() -> str:
    """Hash of the Python files of kinarm, wherever they lie."""
    content = hashlib.sha256()
    for folder in sorted({Path(folder).resolve() for folder in kinarm.__path__}):
        is_package = (folder / "__init__.py").is_file()
        parts = [folder] if is_package else [folder / name for name in BESIDE]
        for path in sorted(path for part in parts for path in part.rglob("*.py")):
            content.update(path.read_bytes())
    return content.hexdigest()[:12]


BESIDE = ("policies", "evaluation", "data")
"""Packages of kinarm that lie beside it in a clone."""


def check_identity(expected: tuple[tuple[str, str], ...]) -> None:
    """Refuse to go on if this worker differs from the command, and name the difference.

    Raises
    ------
    WorkerError
        Names the first difference.
    """
    here = dict(identity())
    for name, wanted in expected:
        found = here.get(name, "not installed")
        if found != wanted:
            raise WorkerError(
                f"a worker differs from this process: {name} is {found} there, {wanted} here"
            )


WATCHED = 0.2
"""How often a worker looks whether its parent is still there [s]."""

ATTEMPTS = 3
"""How often workers may end unexpectedly before another task is finished."""

REPLACED = "A worker stopped while some jobs were given to the executor"
"""How Loky's warning begins of a worker that it replaces because its memory has grown.

Kernels and libraries that a task loads are no leak. The warning comes from the thread that manages
the workers: as an error, it would end that thread, and nothing would go on.
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
    shares_files = True

    def map(
        self, work: Callable[[TaskT], ResultT], tasks: Sequence[TaskT]
    ) -> Iterator[tuple[TaskT, ResultT | Failure]]:
        """Do the work for every task; see `Executor.map`.

        Raises
        ------
        WorkerError
            If workers end unexpectedly three times before another task is finished.
        """
        waiting, failures = dict(enumerate(tasks)), 0
        while waiting:
            try:
                for number, result in self._attempt(Work.of(work), waiting):
                    failures = 0
                    yield waiting.pop(number), result
            except BrokenProcessPool as error:
                failures += 1
                if failures == ATTEMPTS:
                    raise WorkerError(
                        "workers ended unexpectedly, perhaps for want of memory; the same command "
                        "goes on with what is missing"
                    ) from error

    def _attempt(self, work: Work, waiting: dict[int, Any]) -> Iterator[tuple[int, Any]]:
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
        packed = [(number, pickle.dumps(task)) for number, task in waiting.items()]
        with kept_from_children():
            done = parallel(delayed(_done)(work, *item) for item in packed)
        with _closed_in_silence(done):
            for each in done:  # noqa: UP028 - `yield from` would close it first
                yield each


@contextmanager
def _closed_in_silence(done: Any) -> Iterator[None]:
    """Joblib warns of the tasks that are dropped where it is not asked for all."""
    try:
        yield
    finally:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            done.close()


def _done(work: Work, number: int, task: bytes) -> tuple[int, Any]:
    return number, work(task)


def _prepare_worker(parent: int) -> None:
    """End when the parent does."""
    threading.Thread(target=_end_with_parent, args=(parent,), daemon=True).start()


def _end_with_parent(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(WATCHED)
    os._exit(1)
