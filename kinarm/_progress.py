"""One line on standard error that shows progress and the remaining time."""

import math
import time
from collections.abc import Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any

from rich.cells import cell_len
from rich.progress import Progress, ProgressColumn
from rich.text import Text

from kinarm._console import open_console

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Task

BAR = 10
"""Width of the bar."""

LINE_SECONDS = 30.0
"""How often a line is printed where there is no terminal."""


class ProgressLine:
    """Shows progress: a bar on a terminal, and a line now and then elsewhere.

    Parameters
    ----------
    title : str
        What is under way.
    total : float
        How much there is to do.
    unit : str
        What is counted, for the lines where there is no terminal.
    console : rich.console.Console, optional
        Where to show it; standard error by default.
    """

    def __init__(
        self, title: str, total: float, unit: str, console: "Console | None" = None
    ) -> None:
        self._title, self._unit, self._printed = title, unit, time.monotonic()
        self._console = console or open_console(stderr=True)
        self._progress = Progress(
            _Line(self._console),
            console=self._console,
            disable=not self._console.is_terminal,
            speed_estimate_period=math.inf,
        )
        self._task = self._progress.add_task(title, total=total, words=(), count="")

    def __enter__(self) -> "ProgressLine":
        if not self._progress.disable:
            self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if not self._progress.disable:  # before Rich 15, stopping would print an empty line
            self._progress.stop()

    def update(self, done: float | None = None, words: Sequence[str] = (), count: str = "") -> None:
        """Show how far it is.

        Parameters
        ----------
        done : float, optional
            How much is done; as before if it is left out.
        words : sequence of str
            Texts beside the bar; the first ones are left out if the line is too narrow.
        count : str
            How much that is; in numbers of what is done and of all if it is left out.
        """
        self._progress.update(self._task, completed=done, words=tuple(words), count=count)
        if self._progress.disable and time.monotonic() - self._printed > LINE_SECONDS:
            self._printed = time.monotonic()
            task = self._progress.tasks[0]
            said = f"{self._title}: {count_of(task)} {self._unit}"
            self._console.print(", ".join([said, *words, time_left(task)]))


class _Line(ProgressColumn):
    """All of a task in one column, which leaves out what has no room."""

    max_refresh = None

    def __init__(self, console: "Console") -> None:
        super().__init__()
        self._console = console

    def render(self, task: "Task") -> Text:
        """The line as wide as the console is now."""
        ascii_only = self._console.options.ascii_only
        return progress_line(task, self._console.width, "#-" if ascii_only else "━╌")


def progress_line(task: "Task", width: int, marks: str) -> Text:
    """A line no wider than a console; count and time left are always in it.

    First the bar is left out, then words from the first one on, then the title.

    Parameters
    ----------
    task : rich.progress.Task
        What is under way.
    width : int
        Width of the console.
    marks : str
        What the bar is made of: where something is done, and where it is not.
    """
    count, left = count_of(task), time_left(task)
    words: list[str] = list(task.fields["words"])
    title, bar = task.description, BAR
    while True:
        parts = [part for part in (title, "x" * bar, count, *words, left) if part]
        if sum(map(cell_len, parts)) + len(parts) - 1 <= width or not (bar or words or title):
            break
        if bar:
            bar = 0
        elif words:
            del words[0]
        else:
            title = ""
    done = min(bar, round(bar * task.percentage / 100))
    drawn = Text(marks[0] * done, "bar.complete").append(marks[1] * (bar - done), "bar.back")
    pieces: list[Any] = [title, drawn, count, *words, Text(left, "progress.remaining")]
    shown = [Text(piece) if isinstance(piece, str) else piece for piece in pieces]
    return Text(" ", no_wrap=True, overflow="crop").join(piece for piece in shown if piece)


def count_of(task: "Task") -> str:
    """How much is done, of how much."""
    return task.fields["count"] or f"{task.completed:.0f}/{task.total:.0f}"


def time_left(task: "Task") -> str:
    """How long the rest takes, as far as that is known."""
    seconds = task.time_remaining
    if seconds is None:
        return "-:-- left"
    minutes, seconds = divmod(math.ceil(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02} left" if hours else f"{minutes}:{seconds:02} left"
