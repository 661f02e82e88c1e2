"""Files with results, their only reader: ``.npz`` with a header in JSON, without pickle; JSON.

Results that are only computed to be used again lie in the user's cache folder.
"""

import hashlib
import json
import os
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm._files import check_folder, first_line, write_atomically
from kinarm.errors import InvalidInputError, KinarmError, OutputError

KINDS = "biufU"
"""Kinds of what an array may hold: truth values, whole numbers, numbers and texts."""

CACHE_VARIABLE = "KINARM_CACHE"
"""Environment variable that names another cache folder."""

Arrays = Mapping[str, NDArray[Any]]


class Archive(NamedTuple):
    """Arrays of a file by name, and everything else, as JSON holds it."""

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
    """Write a ``.npz`` file whose arrays and header are of some kind, in a version of its format.

    Parameters
    ----------
    file : str, Path or binary file
        The file.
    kind, version
        Name of the kind, such as ``"policy"``, and version of the format.
    arrays, header : mapping
        Arrays by name, and everything else, in terms that JSON can hold.
    compress : bool
        Whether arrays are compressed.
    """
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

    Parameters
    ----------
    path, kind, version
        The file, what it has to hold, and the version that it has to have.
    error : type
        Type of the errors.
    unless : tuple of str
        How the names of arrays begin that are left out.
    """
    name, wanted = repr(str(path)), f"kinarm-{kind.replace(' ', '-')}"
    with reading(name, kind, error), Path(path).open("rb") as file:
        is_other = file.read(2) not in (b"", b"PK")
        content = {} if is_other else _arrays(file, unless)
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


def _arrays(file: IO[bytes], unless: tuple[str, ...]) -> dict[str, NDArray[Any]]:
    file.seek(0)
    with warnings.catch_warnings(action="ignore"), np.load(file, allow_pickle=False) as content:
        arrays = {name: content[name] for name in content.files if not name.startswith(unless)}
    for name, array in arrays.items():
        if not isinstance(array, np.ndarray) or array.dtype.kind not in KINDS:
            raise ValueError(f"{name} is no array of numbers or texts")
    return arrays


def load_json(path: str | Path, kind: str, error: type[KinarmError]) -> Any:
    """Read a JSON document.

    Parameters
    ----------
    path, kind
        The file, and what it holds, for messages.
    error : type
        Type of the errors: that the file is missing, or no JSON.
    """
    with reading(repr(str(path)), kind, error):
        return json.loads(Path(path).read_bytes())


@contextmanager
def reading(
    name: str, kind: str, error: type[KinarmError], *, of: str = "kinarm"
) -> Iterator[None]:
    """Turn what reading a damaged file raises, or making something of it, into one line.

    Parameters
    ----------
    name, kind
        Name of the file, quoted, and what it holds.
    error : type
        Type of the errors; those that have it already pass as they are.
    of : str
        Whose file it is.
    """
    try:
        yield
    except (error, AssertionError):
        raise
    except OSError as problem:
        raise error(f"cannot read {kind} {name}: {problem.strerror}") from problem
    except Exception as problem:  # a damaged file can raise anything
        raise error(f"{name} is not a complete {of} {kind}: {first_line(problem)}") from problem


def cache_folder() -> Path:
    """Folder of the cache: ``$KINARM_CACHE``, or ``kinarm`` in the user's cache folder."""
    users = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(os.environ.get(CACHE_VARIABLE) or Path(users) / "kinarm")


def cached_arrays(
    kind: str, version: int, made_of: bytes, make: Callable[[], Mapping[str, ArrayLike]]
) -> Arrays:
    """Look arrays up in the cache, or make and keep them.

    A file that cannot be read is replaced; where none can be written, nothing is kept.

    Parameters
    ----------
    kind, version
        What they are, one word; the version is raised when the same content makes other arrays.
    made_of : bytes
        Everything that they depend on.
    make : callable
        Makes them.
    """
    path = cache_folder() / f"{kind}-{hashlib.sha256(made_of).hexdigest()[:24]}.npz"
    with suppress(InvalidInputError):
        return load_archive(path, kind, version, InvalidInputError).arrays
    arrays = {name: np.asarray(array) for name, array in make().items()}
    with suppress(OutputError):
        check_folder(path.parent)
        save_archive(path, kind, version, arrays, {})
    return arrays
