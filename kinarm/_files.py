"""Writing files so that a reader never sees half of one.

Each function raises `OutputError`, in one line, where it cannot write.
"""

import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import IO

from kinarm.errors import OutputError


def write_atomically(path: str | Path, write: Callable[[IO[bytes]], object]) -> None:
    """Let ``write`` fill a file beside its place, which is moved there when it is complete."""
    target = Path(path)
    beside = target.with_name(f".{target.name}.{os.urandom(4).hex()}")
    try:
        try:
            with beside.open("xb") as file:
                if target.exists():
                    beside.chmod(target.stat().st_mode)
                write(file)
            beside.replace(target)
        except BaseException:
            beside.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise OutputError(f"cannot write {str(path)!r}: {error.strerror}") from error


def write_text(path: str | Path, text: str) -> None:
    """Write a text file in UTF-8, as `write_atomically` does."""
    write_atomically(path, lambda file: file.write(text.encode()))


def first_line(error: BaseException) -> str:
    """What an error says, in one line; its name if it says nothing."""
    return str(error).splitlines()[0] if str(error) else type(error).__name__


def check_output(path: str | Path, *, overwrite: bool = False, suffix: str = "") -> None:
    """See that a file can be written, before any work is done for it; its folder is made.

    It must not exist unless ``overwrite`` says so, and its name must end in ``suffix``.
    """
    file = Path(path)
    if file.is_dir() or (suffix and file.suffix != suffix):
        ending = f" that ends in {suffix}" if suffix else ""
        raise OutputError(f"the output must be a file{ending}, got {str(path)!r}")
    if file.exists() and not overwrite:
        raise OutputError(f"{str(path)!r} exists: --overwrite replaces it (overwrite=True)")
    check_folder(file.parent)


def check_folder(folder: str | Path) -> None:
    """Make a folder if it is missing, and see that files can be written to it."""
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(f"cannot write to {str(folder)!r}: {error.strerror}") from error
