"""How far many tasks are."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

from kinarm._console import ProgressLine

if TYPE_CHECKING:
    from rich.console import Console


class Costly(Protocol):
    """A task as far as its progress is shown."""

    @property
    def name(self) -> str:
        """What to call it."""

    @property
    def cost(self) -> float:
        """Rough duration relative to other tasks."""


class TaskProgress:
    """Shows how many tasks are finished, which are running and how long the rest will take.

    Parameters
    ----------
    total : int
        Number of tasks, those that were finished before included.
    waiting : sequence
        Those that are still to be done, in the order in which they begin.
    jobs : int
        How many run at a time.
    console : rich.console.Console
        Where to show it: a bar on a terminal, else a line now and then.
    """

    def __init__(
        self, total: int, waiting: Sequence[Costly], jobs: int, console: "Console"
    ) -> None:
        self._total, self._waiting, self._jobs = total, list(waiting), jobs
        self._done = 0.0
        cost = sum(task.cost for task in waiting)
        self._line = ProgressLine("trainings", cost, "finished", console)

    def __enter__(self) -> "TaskProgress":
        self._show()
        self._line.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self._line.__exit__(None, None, None)

    def finished(self, task: Costly) -> None:
        """Take note of a finished task."""
        self._waiting.remove(task)
        self._done += task.cost
        self._show()

    def _show(self) -> None:
        """Bring the line up to date."""
        count = f"{self._total - len(self._waiting)} of {self._total}"
        running = [task.name for task in self._waiting[: self._jobs]]
        self._line.update(self._done, running, count)
