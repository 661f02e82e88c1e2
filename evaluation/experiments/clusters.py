"""Executors that carry tasks out on a cluster: Ray, and array jobs of Slurm."""

import math
import os
import pickle
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

from kinarm._interrupts import kept_from_children
from kinarm.errors import InvalidInputError, MissingExtraError, WorkerError
from kinarm.evaluation.experiments.executors import Failure, Work

TaskT = TypeVar("TaskT")
ResultT = TypeVar("ResultT")

ANSWER_SECONDS = 10.0
"""How long a cluster may take to answer."""

RETRIES = 20
"""How often a task is begun anew whose worker or node was lost."""

WAITING = 4
"""How many tasks wait at the cluster for each processor that it has: more are handed over as
others finish, so that neither the driver nor the cluster holds all of a large study."""


@dataclass(frozen=True)
class RayExecutor:
    """Processors of a Ray cluster; results are sent back, no disk need be shared.

    Parameters
    ----------
    address : str
        ``"local"`` for Ray on this machine alone, ``"auto"`` for the cluster in ``RAY_ADDRESS`` or
        else the one that this machine is part of, or the address of one, such as
        ``"10.0.0.1:6379"`` or ``"ray://head:10001"``.
    jobs : int, optional
        Processors of this machine for ``"local"``; all by default. A cluster has its own.
    threads : int
        Processors that a task takes.
    """

    address: str
    jobs: int | None = None
    threads: int = 1
    shares_files = False

    def map(
        self, work: Callable[[TaskT], ResultT], tasks: Sequence[TaskT]
    ) -> Iterator[tuple[TaskT, ResultT | Failure]]:
        """Do the work for every task; see `Executor.map`.

        What was lost with a worker or a node is done again, elsewhere.

        Raises
        ------
        MissingExtraError
            If Ray is not installed.
        InvalidInputError
            If no cluster answers at the address within ten seconds.
        WorkerError
            If a worker has other versions than this process, or is lost again and again.
        """
        try:
            import ray
        except ImportError as error:
            raise MissingExtraError("ray", "ray") from error
        with kept_from_children():
            self._connect(ray)
        try:
            yield from self._map(ray, work, tasks)
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
            if address != "auto":
                _knock(address.removeprefix("ray://"))
            with warnings.catch_warnings(action="ignore"):  # one line says it
                ray.init(address=address, **quiet)
        except (ConnectionError, OSError, RuntimeError, TimeoutError, ValueError) as error:
            raise InvalidInputError(
                f"no Ray cluster answers at {address!r}: give the address of one, auto "
                "where one runs, or local"
            ) from error

    def _map(
        self, ray: Any, work: Callable[[TaskT], ResultT], tasks: Sequence[TaskT]
    ) -> Iterator[tuple[TaskT, ResultT | Failure]]:
        """Hand tasks over, a few at a time, and take results back."""
        remote = ray.remote(num_cpus=self.threads, max_retries=RETRIES)(_call)
        packed = ray.put(Work.of(work))
        waiting = iter(enumerate(tasks))
        under_way: dict[Any, int] = {}
        try:
            while True:
                room = self._room(ray) - len(under_way)
                for number, task in islice(waiting, max(room, 0)):
                    under_way[remote.remote(packed, pickle.dumps(task))] = number
                if not under_way:
                    return
                done, _ = ray.wait(list(under_way), num_returns=1, timeout=1.0)
                for reference in done:
                    number = under_way.pop(reference)
                    yield tasks[number], self._result(ray, reference)
        finally:
            for reference in under_way:
                with suppress(Exception):
                    ray.cancel(reference, force=True)

    def _room(self, ray: Any) -> int:
        """How many tasks the cluster is given at a time, as large as it is now."""
        processors = math.floor(ray.cluster_resources().get("CPU", 1.0) / self.threads)
        return int(WAITING * max(1, processors))

    def _result(self, ray: Any, reference: Any) -> Any:
        """What a task returned, or what went wrong."""
        try:
            return ray.get(reference)
        except ray.exceptions.RayTaskError as error:
            raise error.cause if isinstance(error.cause, Exception) else error from error
        except ray.exceptions.RayError as error:
            raise WorkerError(
                "workers of the cluster are lost again and again, perhaps for want of memory; the "
                "same command goes on with what is missing"
            ) from error


def _call(work: Work, task: bytes) -> Any:
    """Do the work for a task, in a worker."""
    return work(task)


def _knock(address: str) -> None:
    """See that something listens at an address."""
    import socket

    host, _, port = address.rpartition(":")
    if not host or not port.isdigit():
        raise ValueError(address)
    with socket.create_connection((host, int(port)), timeout=ANSWER_SECONDS):
        pass


LOOK_SECONDS = 0.5
"""How often the driver looks for jobs that ended."""


@dataclass(frozen=True)
class SlurmExecutor:
    """Array jobs of a Slurm cluster, whose machines share the folder with this one.

    Parameters
    ----------
    folder : Path
        Where jobs, their logs and their results lie.
    bundle : int
        Tasks that one element of the array carries out, one after the other.
    minutes : int
        Time limit of an element; one that is preempted or runs out of time goes on where it was.
    threads : int
        Processors of an element.
    partition : str, optional
        Partition of the cluster.
    at_once : int
        Elements that run at the same time, at most.
    cluster : {"slurm", "local"}
        ``"local"`` runs the same jobs as processes of this machine, to try things.
    """

    folder: Path
    bundle: int = 1
    minutes: int = 240
    threads: int = 1
    partition: str | None = None
    at_once: int = 256
    cluster: str = "slurm"
    shares_files = True

    def map(
        self, work: Callable[[TaskT], ResultT], tasks: Sequence[TaskT]
    ) -> Iterator[tuple[TaskT, ResultT | Failure]]:
        """Do the work for every task, bundle by bundle; see `Executor.map`.

        Raises
        ------
        MissingExtraError
            If submitit is not installed.
        InvalidInputError
            If there is no Slurm on this machine, or it refuses the jobs.
        WorkerError
            If a job ends without a result, or a worker has other versions than this process.
        """
        try:
            import submitit
        except ImportError as error:
            raise MissingExtraError("submitit", "slurm") from error
        packed = Work.of(work)
        numbered = [(number, pickle.dumps(task)) for number, task in enumerate(tasks)]
        bundles = [
            Bundle(packed, numbered[first : first + self.bundle])
            for first in range(0, len(numbered), self.bundle)
        ]
        if not bundles:
            return
        jobs = self._submit(submitit, bundles)
        try:
            while jobs:
                ended = [job for job in jobs if job.done()]
                for job in ended:
                    jobs.remove(job)
                    for number, result in self._results(submitit, job):
                        yield tasks[number], result
                if jobs and not ended:
                    time.sleep(LOOK_SECONDS)
        finally:
            for job in jobs:
                with suppress(Exception):
                    job.cancel(check=False)
                    if self.cluster == "local":
                        job.wait()

    def _submit(self, submitit: Any, bundles: "Sequence[Bundle]") -> list[Any]:
        """Hand an array of bundles to the cluster."""
        try:
            executor = submitit.AutoExecutor(folder=self.folder, cluster=self.cluster)
            settings = {"slurm_partition": self.partition} if self.partition else {}
            executor.update_parameters(
                name="kinarm",
                timeout_min=self.minutes,
                cpus_per_task=self.threads,
                slurm_array_parallelism=self.at_once,
                **settings,
            )
            with executor.batch():
                return [executor.submit(bundle) for bundle in bundles]
        except (OSError, RuntimeError, submitit.core.utils.FailedJobError) as error:
            raise InvalidInputError(f"Slurm takes no jobs: {error}") from error

    def _results(self, submitit: Any, job: Any) -> list[tuple[int, Any]]:
        """What a bundle came to, or what went wrong."""
        try:
            return list(job.result())
        except submitit.core.utils.FailedJobError as error:
            raise WorkerError(
                f"job {job.job_id} failed: {_reason(str(error))}; its log is "
                f"{str(job.paths.stderr)!r}, and the same command goes on with what is missing"
            ) from error


def _reason(said: str) -> str:
    """What submitit says of a failed job, in a line: the last one of the traceback, if any."""
    _, _, traced = said.partition("Traceback (most recent call last):\n")
    lines = [line for line in (traced or said).splitlines() if line and not line.startswith(" ")]
    return next((line for line in lines if not line.startswith("-")), "no result")


@dataclass
class Bundle:
    """Tasks of one element of an array, and their results so far.

    Attributes
    ----------
    work : Work
        What to do.
    tasks : list of (int, bytes)
        Pickled tasks with their numbers.
    results : list of (int, object)
        What those that are finished came to, with their numbers.
    """

    work: Work
    tasks: list[tuple[int, bytes]]
    results: list[tuple[int, Any]] = field(default_factory=list)

    def __call__(self) -> list[tuple[int, Any]]:
        """Run the unfinished tasks."""
        for number, task in self.tasks[len(self.results) :]:
            self.results.append((number, self.work(task)))
        return self.results

    def checkpoint(self) -> Any:
        """What Slurm is to run when it takes the machine away: the rest."""
        import submitit

        return submitit.helpers.DelayedSubmission(self)
