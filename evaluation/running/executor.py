"""What an executor is, and what it hands back."""

from collections.abc import Callable, Iterator, Sequence
from typing import Generic, NamedTuple, Protocol, TypeVar

TaskT = TypeVar("TaskT")
ResultT = TypeVar("ResultT")


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
