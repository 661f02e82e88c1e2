"""What an executor is."""

from collections.abc import Callable, Iterator, Sequence
from typing import Protocol, TypeVar

from kinarm.workers import Finished

TaskT = TypeVar("TaskT")
ResultT = TypeVar("ResultT")


class Executor(Protocol):
    """Where tasks are carried out: on this machine, on a cluster, ..."""

    def carry_out(
        self, work: Callable[[TaskT], ResultT], tasks: Sequence[TaskT]
    ) -> Iterator[Finished[ResultT]]:
        """Do the work for every task, begun in the given order; yield what finishes.

        Work, tasks and results can be pickled. The work may be done more than once for a task
        whose worker was lost; a result is yielded once. Abandoned or interrupted, an executor
        drops what is not finished.

        Raises
        ------
        WorkerError
            If workers end unexpectedly, again and again.
        Exception
            What the work raises.
        """
