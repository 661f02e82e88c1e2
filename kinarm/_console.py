"""Terminals of the commands: what they wait for, and progress."""

import math
import os
import sys
import time
from collections.abc import Sequence
from datetime import timedelta
from functools import cache
from importlib.util import find_spec
from typing import IO, TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

PIPED, UNBOUNDED = 120, 1000
"""Widths of piped output, and with room for everything."""

COMPILING = "compiling kernels for this processor, once (about 20 s)"
"""What is waited for while kernels are compiled."""

LINE_SECONDS = 30.0
"""Time between lines of progress without a terminal."""


@cache
def say_why_it_waits(activity: str) -> None:
    """Say on a terminal what takes long, once; also above what shows progress there.

    Only the parent of processes says it.
    """
    from multiprocessing import parent_process

    if parent_process() is None and sys.stderr and sys.stderr.isatty():
        sys.stderr.write(f"kinarm: {activity}...\n")


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
