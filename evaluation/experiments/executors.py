"""Where tasks run: this process, worker processes, or a cluster."""

import os
import pickle
import queue
import socket
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from kinarm import SEMANTICS
from kinarm._files import first_line
from kinarm._interrupts import kept_from_children
from kinarm.errors import InvalidInputError, WorkerError, needed
from kinarm.policies.learners import look_here
from kinarm.policies.provenance import package_versions, source_commit

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


def identity() -> dict[str, str]:
    """Versions of packages and of results, and the commit of kinarm's clone, if there is one."""
    from kinarm.policies.oracle import ORACLE_SEMANTICS  # loads its kernels

    return {
        **package_versions(),
        "semantics": SEMANTICS,
        "oracle semantics": ORACLE_SEMANTICS,
        "commit of kinarm": source_commit(),
    }


def _do_alike(work: Work, expected: Mapping[str, str], task: Any) -> Any:
    """Do the work for a task if the driver's `identity` is the one here.

    Else a `WorkerError` names the first difference. A commit is compared where both know theirs.
    """
    here = identity()
    for name, wanted in expected.items():
        found = here.get(name, "not installed")
        if found and wanted and found != wanted:
            raise WorkerError(
                f"a worker differs from this process: {name} is {found} there, {wanted} here"
            )
    return work(task)


ANSWER_SECONDS = 10.0
"""How long a cluster may take to answer [s]."""

RETRIES = 20
"""How often a task is begun anew after its worker was lost."""

AT_ONCE = 10_000
"""Most tasks that wait at a Ray cluster."""


@dataclass(frozen=True)
class RayExecutor:
    """Processors of a Ray cluster; no disk need be shared.

    Parameters
    ----------
    address : str
        ``"local"`` for this machine alone, ``"auto"`` for the cluster in
        ``RAY_ADDRESS`` or else that of this machine, or an address such as
        ``"10.0.0.1:6379"`` or ``"ray://head:10001"``.
    jobs : int, optional
        Processors of this machine for ``"local"``; all by default.
    threads : int
        Processors that a task takes.
    """

    address: str
    jobs: int | None = None
    threads: int = 1

    def map(self, work: Work, tasks: Sequence[Any]) -> Iterator[tuple[Any, Any | Failure]]:
        """Do the work for every task; see `Executor.map`."""
        if not tasks:
            return
        ray = needed("ray", "ray", "ray")
        with kept_from_children():
            self._connect(ray)
        waiting, under_way = iter(tasks), dict[Any, Any]()
        try:
            remote: Any = ray.remote(num_cpus=self.threads, max_retries=RETRIES)(attempt)
            shared = ray.put(partial(_do_alike, work, identity()))
            while True:
                for task in islice(waiting, AT_ONCE - len(under_way)):
                    under_way[remote.remote(shared, pickle.dumps(task))] = task
                if not under_way:
                    return
                (done,), _ = ray.wait([*under_way])
                yield under_way.pop(done), ray.get(done)
        except ray.exceptions.RayError as error:
            raise WorkerError(
                f"Ray gave a task up: {error}; the same command goes on with what is missing"
            ) from error
        finally:
            ray.shutdown()

    def _connect(self, ray: Any) -> None:
        """Find the cluster, or begin one on this machine."""
        quiet = {"log_to_driver": False, "logging_level": "error"}
        if self.address == "local":  # without the address, Ray would join one that runs here
            ray.init(address="local", num_cpus=self.jobs, include_dashboard=False, **quiet)
            return
        address = self.address
        if address == "auto":  # as Ray reads it
            address = os.environ.get("RAY_ADDRESS") or address
        try:
            if address != "auto":  # Ray itself waits for minutes
                host, _, port = address.removeprefix("ray://").rpartition(":")
                socket.create_connection((host, int(port)), ANSWER_SECONDS).close()
            with warnings.catch_warnings(action="ignore"):  # one line says it
                ray.init(address=address, **quiet)
        except (OSError, RuntimeError, ValueError) as error:
            raise InvalidInputError(
                f"no Ray cluster answers at {address!r}: give the address of one, auto "
                "where one runs, or local"
            ) from error


LOOK_SECONDS = 0.5
"""How often the driver looks for jobs that ended [s]."""


@dataclass(frozen=True)
class SlurmExecutor:
    """Array jobs of a Slurm cluster, which shares the folder with this machine.

    Parameters
    ----------
    folder : Path
        Folder of jobs, logs and results.
    bundle : int
        Tasks of one element of the array, one after the other.
    minutes : int
        Time limit of an element; after preemption or timeout it goes on where
        it was.
    threads : int
        Processors of an element.
    cluster : {"slurm", "local"}
        ``"local"`` runs the same jobs as processes of this machine.
    """

    folder: Path
    bundle: int = 1
    minutes: int = 240
    threads: int = 1
    cluster: str = "slurm"

    def map(self, work: Work, tasks: Sequence[Any]) -> Iterator[tuple[Any, Any | Failure]]:
        """Do the work for every task, bundle by bundle; see `Executor.map`."""
        submitit = needed("submitit", "submitit", "slurm")
        parts = [tasks[k : k + self.bundle] for k in range(0, len(tasks), self.bundle)]
        alike, jobs = partial(_do_alike, work, identity()), list[Any]()
        if not parts:
            return
        try:
            executor = submitit.AutoExecutor(folder=self.folder, cluster=self.cluster)
            executor.update_parameters(
                name="kinarm", timeout_min=self.minutes, cpus_per_task=self.threads
            )
            with executor.batch():
                for part in parts:
                    bundle = submitit.helpers.FunctionSequence()  # goes on where it was interrupted
                    for task in part:
                        bundle.add(attempt, alike, pickle.dumps(task))
                    jobs.append(executor.submit(bundle))
        except (OSError, RuntimeError, submitit.core.utils.FailedJobError) as error:
            raise InvalidInputError(f"Slurm takes no jobs: {error}") from error
        try:
            for job in submitit.helpers.as_completed(jobs, poll_frequency=LOOK_SECONDS):
                yield from zip(parts[jobs.index(job)], job.result(), strict=True)
        except submitit.core.utils.FailedJobError as error:
            raise WorkerError(
                f"a job failed; the same command goes on with what is missing: {error}"
            ) from error
        finally:
            for job in jobs:
                with suppress(Exception):
                    if not job.done():
                        job.cancel(check=False)
