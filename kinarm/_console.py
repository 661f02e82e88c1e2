"""Terminals as the commands use them."""

import sys
from typing import IO, TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console


def open_console(
    *, stderr: bool = False, piped_width: int | None = None, file: IO[str] | None = None
) -> "Console":
    """A console that prints texts as they are: names and paths hold no markup.

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
        stderr=stderr, file=file, width=width, markup=False, emoji=False, highlight=False
    )
