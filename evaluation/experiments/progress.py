"""How far an experiment is: tasks that are finished, and those under way on this machine."""

import tempfile
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from kinarm._console import ProgressLine, told_of_activities
from kinarm.policies.learners import TrainingState

RENEWED = 0.2
"""How often the shown progress is renewed [s]."""

ROW = np.dtype([("done", "f8"), ("success", "f8"), ("activity", "U48")])
"""What is known of a training: share that is done, share of success, and what takes long."""


@dataclass(frozen=True)
class Watcher:
    """Notes how far a training is in a file that processes of this machine share.

    Parameters
    ----------
    path : Path
        The file.
    number : int
        Which of the tasks it is.
    count : int
        How many tasks there are.
    """

    path: Path
    number: int
    count: int

    @cached_property
    def rows(self) -> "np.memmap[Any, np.dtype[Any]]":
        """What is known of each task, as all processes see it, shape (count,)."""
        return np.memmap(self.path, ROW, "r+", shape=(self.count,))

    @contextmanager
    def preparing(self) -> Iterator[None]:
        """Note what takes long before the first iteration."""

        def note(activity: str) -> None:
            self.rows["activity"][self.number] = activity

        with told_of_activities(note):
            yield
        note("")

    def update(self, state: TrainingState, iterations: int) -> None:
        """Note the latest of so many iterations."""
        self.rows[self.number] = (state.iteration / iterations, state.curve[-1].success, "")


class Task(Protocol):
    """A task as far as its progress is shown."""

    @property
    def name(self) -> str:
        """What to call it."""

    @property
    def cost(self) -> float:
        """Rough duration relative to other tasks."""

    def watched(self, watcher: Watcher) -> "Task":
        """The task, which tells a watcher how far it is."""


class Progress:
    """Shows how many tasks are finished, which are running and how long the rest will take.

    Parameters
    ----------
    total : int
        Number of tasks, those that were finished before included.
    waiting : sequence
        Those that are still to be done, in the order in which they begin.
    jobs : int
        How many run at a time.

    Attributes
    ----------
    tasks : list
        What is to be done, watched.
    """

    def __init__(self, total: int, waiting: Sequence[Task], jobs: int) -> None:
        self._earlier, self._jobs = total - len(waiting), jobs
        self.tasks: list[Any] = list(waiting)
        self._finished: set[int] = set()
        self._costs = np.array([task.cost for task in waiting])
        self._line = ProgressLine("trainings", float(self._costs.sum()), "finished")
        self._over, self._stack = threading.Event(), ExitStack()

    def __enter__(self) -> "Progress":
        folder = self._stack.enter_context(tempfile.TemporaryDirectory(prefix="kinarm-"))
        self._path = Path(folder) / "rows"
        count = len(self.tasks)
        np.zeros(count, ROW).tofile(self._path)
        self.tasks = [
            task.watched(Watcher(self._path, number, count))
            for number, task in enumerate(self.tasks)
        ]
        self._show()
        self._stack.enter_context(self._line)
        thread = threading.Thread(target=self._renew, daemon=True)
        thread.start()
        self._stack.callback(thread.join)
        self._stack.callback(self._over.set)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def finished(self, task: Task) -> None:
        """Take note of a finished task."""
        self._finished.add(self.tasks.index(task))
        self._show()

    def _renew(self) -> None:
        while not self._over.wait(RENEWED):
            self._show()

    def _show(self) -> None:
        """Bring the line up to date."""
        rows = np.fromfile(self._path, ROW)[: len(self.tasks)]
        rows["done"][[*self._finished]] = 1.0
        left = [k for k in range(len(self.tasks)) if k not in self._finished][: self._jobs]
        words = [self.tasks[number].name for number in left]
        known = rows["success"][(rows["done"] > 0) & np.isfinite(rows["success"])]
        words += [*filter(None, rows["activity"][left])][:1]
        if len(known):
            ends = dict.fromkeys((f"{100 * known.min():.0f}", f"{100 * known.max():.0f}"))
            words.append(f"success {'-'.join(ends)} %")
        count = f"{self._earlier + len(self._finished)} of {self._earlier + len(self.tasks)}"
        self._line.update(float(self._costs @ rows["done"]), words, count)
