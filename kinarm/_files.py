"""Writing files so that a reader never sees half of one."""

import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import IO

from kinarm.errors import OutputError


def write_atomically(path: str | Path, write: Callable[[IO[bytes]], object]) -> None:
    """Write a file beside its place and move it there when it is complete.

    Parameters
    ----------
    path : str or Path
        The file; its folder must exist. An existing file is replaced only on success.
    write : callable
        Writes the content to a binary file.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    try:
        _write_and_move(Path(path), write)
    except OSError as error:
        raise OutputError(f"cannot write {str(path)!r}: {error.strerror}") from error


def write_text(path: str | Path, text: str) -> None:
    """Write a text file in UTF-8, as `write_atomically` does.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    write_atomically(path, lambda file: file.write(text.encode()))


def first_line(error: BaseException) -> str:
    """What an error says, in one line; its name if it says nothing."""
    return str(error).splitlines()[0] if str(error) else type(error).__name__


def _write_and_move(target: Path, write: Callable[[IO[bytes]], object]) -> None:
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            write(file)
        mode = target.stat().st_mode if target.exists() else 0o666 & ~_umask()
        Path(name).chmod(mode)
        Path(name).replace(target)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def check_output(path: str | Path, *, overwrite: bool = False, suffix: str = "") -> None:
    """See that a file can be written, before any work is done for it; its folder is made.

    Parameters
    ----------
    path : str or Path
        The file.
    overwrite : bool
        Whether it may exist already.
    suffix : str
        What its name has to end in.

    Raises
    ------
    OutputError
        If it cannot be written, exists and may not, or has another ending.
    """
    file = Path(path)
    if file.is_dir() or (suffix and file.suffix != suffix):
        ending = f" that ends in {suffix}" if suffix else ""
        raise OutputError(f"the output must be a file{ending}, got {str(path)!r}")
    if file.exists() and not overwrite:
        raise OutputError(f"{str(path)!r} exists: --overwrite replaces it (overwrite=True)")
    check_folder(file.parent)


def check_folder(folder: str | Path) -> None:
    """Make a folder if it is missing, and see that files can be written to it.

    Parameters
    ----------
    folder : str or Path
        The folder.

    Raises
    ------
    OutputError
        If it cannot be made or written to.
    """
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(f"cannot write to {str(folder)!r}: {error.strerror}") from error


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
