"""Terminals as the commands use them."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import IO, TYPE_CHECKING

from kinarm.kernels.notices import COMPILING, told_of_compilation

if TYPE_CHECKING:
    from rich.console import Console


def open_console(
    *, stderr: bool = False, piped_width: int | None = None, file: IO[str] | None = None
) -> "Console":
    """A console that prints texts as they are: names and paths hold no markup.

    In a notebook without ipywidgets, where rich cannot redraw and warns of it, a bar is a line
    that is printed at the end.

    Parameters
    ----------
    stderr : bool
        Whether it is standard error.
    piped_width : int, optional
        Width where standard output is no terminal.
    file : text stream, optional
        Where else to print to.
    """
    from rich.console import Console

    width = piped_width if file is not None or not sys.stdout.isatty() else None
    return Console(
        stderr=stderr,
        file=file,
        width=width,
        markup=False,
        emoji=False,
        highlight=False,
        force_jupyter=None if find_spec("ipywidgets") else False,
    )


@contextmanager
def working(doing: str) -> Iterator[Callable[[str], object]]:
    """Say on standard error what a command is doing, while it does it, if that is a terminal.

    Yields a function by which it says something else. While kernels are compiled, it says so.
    """
    said = doing
    with open_console(stderr=True).status(doing) as status:

        def say(text: str) -> None:
            nonlocal said
            said = text
            status.update(text)

        def tell(begins: bool) -> None:
            status.update(f"{said}; {COMPILING}" if begins else said)

        with told_of_compilation(tell):
            yield say
