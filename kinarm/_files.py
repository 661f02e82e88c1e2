"""Writing files so that a reader never sees half of one, and what can be said of paths.

Each function that writes raises `OutputError`, in one line, where it cannot.
"""

import fcntl
import io
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import IO

from kinarm.errors import OutputError, UnknownNameError

is_file, is_folder = os.path.isfile, os.path.isdir
"""Whether there is such a file or folder; not, if none can have this name."""


@contextmanager
def _reported(path: str | Path, doing: str = "write") -> Iterator[None]:
    """Report in one line why a path cannot be written."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"cannot {doing} {str(path)!r}: {error.strerror}") from error


def write_atomically(path: str | Path, write: Callable[[IO[bytes]], object]) -> None:
    """Let ``write`` fill a file beside its place, which is moved there when it is complete.

    A link is followed. What is no regular file, such as a device, is written to as it stands.
    What a process was killed over lies in the way of nobody: the next one writes over it.
    """
    target = Path(os.path.realpath(path))
    beside = target.with_name(f".{target.name}.part")
    with _reported(path):
        if target.exists() and not (target.is_file() or target.is_dir()):
            write(content := io.BytesIO())
            target.write_bytes(content.getvalue())
            return
        with _locked(beside, wait=True) as file:
            try:
                if target.exists():
                    beside.chmod(target.stat().st_mode)
                file.truncate()
                write(file)
                file.flush()
                os.fsync(file.fileno())
                beside.replace(target)
            except BaseException:
                beside.unlink(missing_ok=True)
                raise


def write_text(path: str | Path, text: str) -> None:
    """Write a text file in UTF-8, as `write_atomically` does."""
    write_atomically(path, lambda file: file.write(text.encode()))


@contextmanager
def only_writer(path: str | Path) -> Iterator[None]:
    """Keep other processes from making the same output, a file or a folder, meanwhile."""
    lock = _lock_of(path)
    with _reported(path):
        try:
            file = _locked(lock)
        except BlockingIOError:
            raise OutputError(f"another process is writing {str(path)!r}") from None
    with file:
        try:
            yield
        finally:
            lock.unlink(missing_ok=True)


def is_being_written(path: str | Path) -> bool:
    """Whether a process is making an output as its `only_writer`."""
    try:
        with _lock_of(path).open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False


def _lock_of(path: str | Path) -> Path:
    """The file that is locked while an output is made."""
    target = Path(os.path.realpath(path))
    return target / ".lock" if target.is_dir() else target.with_name(f".{target.name}.lock")


def _locked(path: Path, *, wait: bool = False) -> IO[bytes]:
    """Open and lock a file that its last owner may just be moving or removing."""
    operation = fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB
    while True:
        file = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT, 0o666), "r+b")
        try:
            fcntl.flock(file, operation)
            if os.path.samestat(os.fstat(file.fileno()), path.stat()):
                return file
        except FileNotFoundError:
            pass
        except BaseException:
            file.close()
            raise
        file.close()


@cache
def shipped_files(folder: str, suffix: str = ".toml") -> Mapping[str, Path]:
    """Files of a folder of kinarm's data, such as ``"scenes"``, by name."""
    with resources.as_file(resources.files("kinarm.data") / folder) as path:
        return MappingProxyType({file.stem: file for file in sorted(path.glob(f"*{suffix}"))})


def named_file(what: str, name: str | Path, others: Iterable[str] = ()) -> Path:
    """The file of what ships with kinarm, or a path that looks like one.

    Parameters
    ----------
    what, name
        What it holds, such as ``"scene"``, and its name or path.
    others : iterable of str
        Further names that exist, for the message of UnknownNameError.
    """
    shipped, path = shipped_files(f"{what}s"), Path(name)
    if str(name) in shipped:
        return shipped[str(name)]
    if path.suffix == ".toml" or is_file(path) or path.parent != Path():
        return path
    available = dict.fromkeys((*others, *shipped, f"path/to/{what}.toml"))
    raise UnknownNameError(what, str(name), available)


def absolute(path: str | Path) -> Path:
    """The absolute path without links."""
    return Path(os.path.realpath(path))


def first_line(error: BaseException) -> str:
    """Message of an error, in one line; its name if it has none."""
    return str(error).splitlines()[0] if str(error) else type(error).__name__


def check_output(path: str | Path, *, overwrite: bool = False, suffix: str = "") -> None:
    """See that a file can be written, before any work is done for it; its folder is made.

    Parameters
    ----------
    path, overwrite
        The file, and whether it may exist.
    suffix : str
        What its name has to end in.
    """
    file = Path(path)
    with _reported(path):
        is_folder, exists = file.is_dir(), file.exists()
    if is_folder or (suffix and file.suffix != suffix):
        ending = f" that ends in {suffix}" if suffix else ""
        raise OutputError(f"the output must be a file{ending}, got {str(path)!r}")
    if exists and not overwrite:
        refused = OutputError(f"{str(path)!r} exists: --overwrite replaces it")
        refused.add_note("in Python: overwrite=True")
        raise refused
    check_folder(file.parent)


def check_folder(folder: str | Path) -> None:
    """Make a folder if it is missing, and see that files can be written to it."""
    with _reported(folder, "write to"):
        Path(folder).mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
