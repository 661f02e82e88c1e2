"""How far many tasks are."""

import math
import time
from collections.abc import Sequence
from typing import Protocol

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

LINE_SECONDS = 30.0
"""How often a line is printed, at most, where there is no terminal."""


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

    def __init__(self, total: int, waiting: Sequence[Costly], jobs: int, console: Console) -> None:
        self._total, self._waiting, self._jobs = total, list(waiting), jobs
        self._printed = time.monotonic()
        self._progress = Progress(
            TextColumn("{task.fields[finished]}"),
            BarColumn(bar_width=20),
            TimeRemainingColumn(),
            TextColumn("{task.fields[running]}"),
            console=console,
            disable=not console.is_terminal,
            speed_estimate_period=math.inf,
        )
        cost = sum(task.cost for task in waiting)
        self._bar = self._progress.add_task("", total=cost, finished="", running="")

    def __enter__(self) -> "TaskProgress":
        self._show(0.0)
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def finished(self, task: Costly) -> None:
        """Take note of a finished task."""
        self._waiting.remove(task)
        self._show(task.cost)
        if self._progress.disable and time.monotonic() - self._printed > LINE_SECONDS:
            self._printed = time.monotonic()
            seconds = self._progress.tasks[0].time_remaining
            left = "" if seconds is None else f", about {seconds / 60:.0f} min left"
            self._progress.console.print(f"{self._finished()} finished{left}")

    def _show(self, cost: float) -> None:
        """Bring the bar up to date, by the cost of what was finished just now."""
        running = ", ".join(task.name for task in self._waiting[: self._jobs])
        self._progress.update(self._bar, advance=cost, finished=self._finished(), running=running)

    def _finished(self) -> str:
        return f"{self._total - len(self._waiting)} of {self._total} trainings"
