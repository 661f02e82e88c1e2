"""Terminals of the commands: activities and progress."""

import math
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import timedelta
from functools import cache
from importlib.util import find_spec
from typing import IO, TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

PIPED, UNBOUNDED = 120, 1000
"""Widths of piped output, and with room for everything."""

COMPILING = "compiling kernels for this processor, once (about 20 s)"
"""Activity while kernels are compiled."""

LINE_SECONDS = 30.0
"""Time between lines of progress without a terminal."""

_listeners: list[Callable[[str], object]] = []
_activities = [""]


@contextmanager
def told_of_activities(listener: Callable[[str], object]) -> Iterator[None]:
    """Tell a listener what begins, and what goes on when it is over, or ""."""
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)


@contextmanager
def doing(activity: str) -> Iterator[None]:
    """Tell listeners of what takes long, but not of the same within it."""
    if activity == _activities[-1]:
        yield
        return
    _activities.append(activity)
    _tell()
    try:
        yield
    finally:
        _activities.remove(activity)
        _tell()


def _tell() -> None:
    for listener in _listeners:
        listener(_activities[-1])
    if _activities[-1] == COMPILING and not _listeners:
        _say_why_it_waits()


@cache
def _say_why_it_waits() -> None:
    """Say on a terminal, once, that kernels are compiled, where no command and no parent does."""
    from multiprocessing import parent_process

    if parent_process() is None and sys.stderr and sys.stderr.isatty():
        sys.stderr.write(f"kinarm: {COMPILING}...\n")


def open_console(*, stderr: bool = False, file: IO[str] | None = None) -> "Console":
    """A console that prints texts without markup.

    It is as wide as the terminal, or as ``COLUMNS`` of the environment says. Piped standard output
    without it has `PIPED` characters; files are unbounded.
    """
    from rich.console import Console

    piped = not stderr and not sys.stdout.isatty() and "COLUMNS" not in os.environ
    width = PIPED if piped else None
    return Console(
        stderr=stderr,
        file=file,
        width=width if file is None else UNBOUNDED,
        markup=False,
        emoji=False,
        highlight=False,
        force_jupyter=None if find_spec("ipywidgets") else False,  # it needs them to redraw
    )


@contextmanager
def working(doing: str) -> Iterator[Callable[[str], object]]:
    """Say what a command is doing on standard error, if that is a terminal.

    Yields a function to say something else, and tells of compilation.
    """
    said = doing
    with open_console(stderr=True).status(doing) as status:

        def say(text: str) -> None:
            nonlocal said
            said = text
            status.update(text)

        def tell(activity: str) -> None:
            status.update(f"{said}; {activity}" if activity else said)

        with told_of_activities(tell):
            yield say


class ProgressLine:
    """Shows progress and remaining time: a bar on a terminal, else lines now and then.

    It counts units up to a total, on standard error by default.
    """

    def __init__(
        self, title: str, total: float, unit: str, console: "Console | None" = None
    ) -> None:
        from rich.progress import BarColumn, Progress, TextColumn

        self._title, self._unit, self._printed = title, unit, time.monotonic()
        self._console = console or open_console(stderr=True)
        self._progress = Progress(
            BarColumn(10),
            TextColumn("{task.fields[text]}", markup=False),
            console=self._console,
            disable=not self._console.is_terminal,
            speed_estimate_period=math.inf,
        )
        self._task = self._progress.add_task(title, total=total, text="")

    def __enter__(self) -> "ProgressLine":
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        if not self._progress.disable:  # before Rich 15, stopping would print an empty line
            self._progress.stop()

    def update(self, done: float | None = None, words: Sequence[str] = ()) -> None:
        """Show how much is done, by default as before; words end the line, important ones first."""
        self._progress.update(self._task, completed=done)
        task = self._progress.tasks[0]
        count = f"{int(task.completed)}/{task.total:.0f}"
        seconds = task.time_remaining
        left = "-:--:--" if seconds is None else timedelta(seconds=math.ceil(seconds))
        if not self._progress.disable:
            text = " ".join([f"{self._title}: {count}", f"{left} left", *words])
            self._progress.update(self._task, text=text)
        elif time.monotonic() - self._printed > LINE_SECONDS:
            self._printed = time.monotonic()
            line = ", ".join([f"{self._title}: {count} {self._unit}", f"{left} left", *words])
            self._console.print(line)
