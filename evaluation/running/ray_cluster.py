"""A Ray cluster as executor."""

import math
import os
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, TypeVar

from kinarm._interrupts import kept_from_children
from kinarm.errors import InvalidInputError, MissingExtraError, WorkerError
from kinarm.evaluation.running.identity import Guarded, identity
from kinarm.workers import Finished

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

    def carry_out(
        self, work: Callable[[TaskT], ResultT], tasks: Sequence[TaskT]
    ) -> Iterator[Finished[ResultT]]:
        """Do the work for every task, begun in the given order; yield what finishes.

        What was lost with a worker or a node is done again, elsewhere. Abandoned or interrupted,
        what is not finished is cancelled.

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
            yield from self._carry_out(ray, work, tasks)
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

    def _carry_out(
        self, ray: Any, work: Callable[[TaskT], ResultT], tasks: Sequence[TaskT]
    ) -> Iterator[Finished[ResultT]]:
        """Hand tasks over, a few at a time, and take results back."""
        remote = ray.remote(num_cpus=self.threads, max_retries=RETRIES)(_call)
        guarded = ray.put(Guarded(work, identity()))
        waiting = iter(enumerate(tasks))
        under_way: dict[Any, int] = {}
        try:
            while True:
                room = self._room(ray) - len(under_way)
                for number, task in _first(waiting, room):
                    under_way[remote.remote(guarded, task)] = number
                if not under_way:
                    return
                done, _ = ray.wait(list(under_way), num_returns=1, timeout=1.0)
                for reference in done:
                    number = under_way.pop(reference)
                    yield Finished(number, self._result(ray, reference))
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


def _call(work: Callable[[TaskT], ResultT], task: TaskT) -> ResultT:
    """Do the work for a task, in a worker."""
    return work(task)


def _first(items: Iterator[Any], count: int) -> Iterator[Any]:
    """The next items, so many at most."""
    for _ in range(count):
        try:
            yield next(items)
        except StopIteration:
            return


def _knock(address: str) -> None:
    """See that something listens at an address."""
    import socket

    host, _, port = address.rpartition(":")
    if not host or not port.isdigit():
        raise ValueError(address)
    with socket.create_connection((host, int(port)), timeout=ANSWER_SECONDS):
        pass
