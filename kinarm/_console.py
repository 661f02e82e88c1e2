"""Terminals as the commands use them."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from typing import IO, TYPE_CHECKING

from kinarm._activities import told_of_activities

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table


UNBOUNDED = 1000
"""Width that has room for every table."""


def open_console(*, stderr: bool = False, file: IO[str] | None = None) -> "Console":
    """A console that prints texts as they are: names and paths hold no markup.

    It is as wide as the terminal. Standard output that is no terminal, and a file, are unbounded;
    the environment variable ``COLUMNS`` sets another width of standard output.

    In a notebook without ipywidgets, where rich cannot redraw and warns of it, a bar is a line
    that is printed at the end.

    Parameters
    ----------
    stderr : bool
        Whether it is standard error.
    file : text stream, optional
        Where else to print to.
    """
    from rich.console import Console

    piped = not stderr and not sys.stdout.isatty() and "COLUMNS" not in os.environ
    return Console(
        stderr=stderr,
        file=file,
        width=UNBOUNDED if file is not None or piped else None,
        markup=False,
        emoji=False,
        highlight=False,
        force_jupyter=None if find_spec("ipywidgets") else False,
    )


def print_fitting(
    console: "Console",
    table_without: Callable[[Sequence[str]], "Table"],
    expendable: Sequence[str],
    advice: str,
) -> None:
    """Print a table without the columns for which there is no room, and name these.

    Parameters
    ----------
    console : rich.console.Console
        Where to print it.
    table_without : callable
        The table without some columns, given their headings.
    expendable : sequence of str
        Headings of columns that can be left out, in that order.
    advice : str
        How to see them all.
    """
    unbounded = console.options.update(width=UNBOUNDED)
    for count in range(len(expendable) + 1):
        left_out = expendable[:count]
        table = table_without(left_out)
        if console.measure(table, options=unbounded).maximum <= console.width:
            break
    console.print(table)
    if left_out:
        note = f"columns that do not fit here: {', '.join(left_out)}; {advice}"
        console.print(note, style="dim")


@contextmanager
def working(doing: str) -> Iterator[Callable[[str], object]]:
    """Say on standard error what a command is doing, while it does it, if that is a terminal.

    Yields a function by which it says something else. While kernels are compiled, it says so, too.
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
