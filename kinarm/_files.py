"""Files: written whole or not at all, and read so that damage is one line.

What cannot be written is an `OutputError`. Arrays lie in ``.npz`` files with a header in JSON,
without pickle, which `load_archive` alone reads.
"""

import fcntl
import hashlib
import io
import json
import os
import tempfile
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm.errors import InvalidInputError, KinarmError, OutputError, UnknownNameError

is_file, is_folder = os.path.isfile, os.path.isdir
"""Whether a file or folder exists; impossible names are none."""

KINDS = "biufU"
"""Kinds of arrays: truth values, whole numbers, numbers and texts."""

CACHE_VARIABLE = "KINARM_CACHE"
"""Environment variable for another cache folder."""

Arrays = Mapping[str, NDArray[Any]]


@contextmanager
def _reported(path: str | Path, doing: str = "write") -> Iterator[None]:
    """Report in one line why a path cannot be written."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"cannot {doing} {str(path)!r}: {error.strerror}") from error


def write_atomically(path: str | Path, write: Callable[[IO[bytes]], object]) -> None:
    """Let ``write`` fill a file beside its place, which then is moved there.

    Links are followed, and devices written to directly. What a killed process leaves is overwritten
    by the next one.
    """
    target = absolute(path)
    beside = target.with_name(f".{target.name}.part")
    with _reported(path):
        if target.exists() and not (target.is_file() or target.is_dir()):
            write(content := io.BytesIO())
            target.write_bytes(content.getvalue())
            return
        with _locked(beside, wait=True) as file:
            try:
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
    """Keep other processes from making the same output."""
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
    """Whether a process is the `only_writer` of an output."""
    try:
        with _lock_of(path).open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False


def _lock_of(path: str | Path) -> Path:
    """File that is locked while an output is made."""
    target = absolute(path)
    return target / ".lock" if target.is_dir() else target.with_name(f".{target.name}.lock")


def _locked(path: Path, *, wait: bool = False) -> IO[bytes]:
    """Open and lock a file, even while it is moved or removed."""
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
    """Files of kinarm's data, such as ``"scenes"``, by name."""
    with resources.as_file(resources.files("kinarm.data") / folder) as path:
        return MappingProxyType({file.stem: file for file in sorted(path.glob(f"*{suffix}"))})


def named_file(what: str, name: str | Path, others: Iterable[str] = ()) -> Path:
    """File of what ships with kinarm, such as a ``"scene"``, or a path that looks like one.

    The message about an unknown name lists the others as well.
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
    """Message of an error in one line; its type's name if empty."""
    return str(error).splitlines()[0] if str(error) else type(error).__name__


def check_output(path: str | Path, *, overwrite: bool = False, suffix: str = "") -> None:
    """Make a file's folder, and see that the file can be written, before any work."""
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
    """Make a missing folder, and see that it can be written to."""
    with _reported(folder, "write to"):
        Path(folder).mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass


class Archive(NamedTuple):
    """Arrays of a file by name, and the rest as JSON."""

    header: dict[str, Any]
    arrays: dict[str, NDArray[Any]]


def save_archive(
    file: str | Path | IO[bytes],
    kind: str,
    version: int,
    arrays: Arrays,
    header: Mapping[str, Any],
    *,
    compress: bool = False,
) -> None:
    """Write a ``.npz`` file of a kind, such as ``"policy"``: arrays, and a header for JSON."""
    content: dict[str, Any] = {
        "format": np.array(f"kinarm-{kind.replace(' ', '-')}"),
        "version": np.array(version),
        "header": np.array(json.dumps(header, sort_keys=True)),
        **arrays,
    }
    save = np.savez_compressed if compress else np.savez
    if isinstance(file, str | Path):
        write_atomically(file, lambda opened: save(opened, **content))
    else:
        save(file, **content)


def load_archive(
    path: str | Path,
    kind: str,
    version: int,
    error: type[KinarmError],
    *,
    unless: tuple[str, ...] = (),
) -> Archive:
    """Read what `save_archive` wrote, or refuse the file in one line.

    Arrays are left out whose names begin with one of ``unless``.
    """
    name, wanted = repr(str(path)), f"kinarm-{kind.replace(' ', '-')}"
    with reading(name, kind, error), Path(path).open("rb") as file:
        content = dict[str, NDArray[Any]]()
        if file.read(2) in (b"", b"PK"):
            file.seek(0)
            with warnings.catch_warnings(action="ignore"), np.load(file, allow_pickle=False) as npz:
                content = {each: npz[each] for each in npz.files if not each.startswith(unless)}
        for each, array in content.items():
            if not isinstance(array, np.ndarray) or array.dtype.kind not in KINDS:
                raise ValueError(f"{each} is no array of numbers or texts")
        if "format" not in content:
            raise error(f"{name} is not a kinarm {kind}")
        given = str(content.pop("format"))
        if given != wanted:
            raise error(f"{name} holds {given[:40]!r}, not {wanted!r}")
        found = int(content.pop("version"))
        if found != version:
            age = "a later" if found > version else "an earlier"
            raise error(
                f"{name} has format version {found}, of {age} kinarm; this one reads {version}"
            )
        header = json.loads(str(content.pop("header")))
        if not isinstance(header, dict):
            raise error(f"{name} is not a complete kinarm {kind}: its header is no table")
        return Archive(header, content)


@contextmanager
def reading(
    name: str, kind: str, error: type[KinarmError], *, of: str = "kinarm"
) -> Iterator[None]:
    """Turn any error of reading a damaged file into one line; those of its type pass as they are.

    The line has the file's name, which is quoted already, its kind, and whose file it is.
    """
    try:
        yield
    except error:
        raise
    except OSError as problem:
        raise error(f"cannot read {kind} {name}: {problem.strerror}") from problem
    except Exception as problem:  # a damaged file can raise anything
        raise error(f"{name} is not a complete {of} {kind}: {first_line(problem)}") from problem


def cache_folder() -> Path:
    """``$KINARM_CACHE``, or ``kinarm`` in the user's cache folder."""
    users = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(os.environ.get(CACHE_VARIABLE) or Path(users) / "kinarm")


def cached_arrays(
    kind: str,
    version: int,
    made_of: bytes,
    make: Callable[[], Mapping[str, ArrayLike]],
    *,
    compress: bool = False,
) -> Arrays:
    """Look arrays up in the cache, or make and keep them.

    They depend on what they are ``made_of`` alone; the version is raised when they change. A file
    that is damaged is replaced; what cannot be written is not kept.
    """
    path = cache_folder() / f"{kind}-{hashlib.sha256(made_of).hexdigest()[:24]}.npz"
    with suppress(InvalidInputError):
        return load_archive(path, kind, version, InvalidInputError).arrays
    arrays = {name: np.asarray(array) for name, array in make().items()}
    with suppress(OutputError, OSError):
        check_folder(path.parent)
        save_archive(path, kind, version, arrays, {}, compress=compress)
    return arrays
