"""Writing files so that a reader never sees half of one, and what reading damaged ones raises."""

import os
import tempfile
import tokenize
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

from kinarm.errors import OutputError

CORRUPT = (
    ValueError,
    KeyError,
    TypeError,
    EOFError,
    RuntimeError,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)
"""What reading a damaged ``.npz`` raises."""


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


def open_archive(
    name: str, file: IO[bytes], *, kind: str, file_format: str, version: int, error: type[Exception]
) -> Any:
    """Open an ``.npz`` file without pickle, and see that it is of our making.

    Parameters
    ----------
    name : str
        Name of the file, for messages.
    file : binary file
        The file.
    kind : str
        What it should hold, such as ``"policy"``.
    file_format : str
        What its entry ``format`` has to say.
    version : int
        The latest version that can be read.
    error : type
        What to raise.

    Returns
    -------
    numpy.lib.npyio.NpzFile
        Its content.
    """
    import numpy as np

    content = np.load(file, allow_pickle=False)
    if not isinstance(content, np.lib.npyio.NpzFile) or "format" not in content:
        raise error(f"{name!r} is not a kinarm {kind}")
    if str(content["format"]) != file_format:
        raise error(f"{name!r} holds {str(content['format'])!r}, not {file_format!r}")
    if int(content["version"]) > version:
        raise error(
            f"{name!r} has format version {int(content['version'])}; "
            f"this kinarm reads up to {version}"
        )
    return content


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


def check_folder(folder: str | Path, *, create: bool = False) -> None:
    """See that files can be written to a folder, before any work is done for them.

    Parameters
    ----------
    folder : str or Path
        The folder.
    create : bool
        Whether to create it if it is missing.

    Raises
    ------
    OutputError
        If it is missing or cannot be written to.
    """
    try:
        if create:
            Path(folder).mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(f"cannot write to {str(folder)!r}: {error.strerror}") from error


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
