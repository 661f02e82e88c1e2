"""The only reader and writer of ``.npz`` files: a header in JSON and arrays, without pickle."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm._files import first_line, write_atomically
from kinarm.errors import KinarmError

Arrays = Mapping[str, NDArray[Any]]


class Archive(NamedTuple):
    """What a file holds.

    Attributes
    ----------
    header : dict
        Everything but the arrays, as JSON holds it.
    arrays : dict of str to ndarray
        The arrays by name.
    """

    header: dict[str, Any]
    arrays: dict[str, NDArray[Any]]


def save_archive(
    path: str | Path,
    kind: str,
    version: int,
    arrays: Arrays,
    header: Mapping[str, Any],
    *,
    compress: bool = False,
) -> None:
    """Write arrays and a header, which JSON can hold; ``kind`` says of what, such as ``"policy"``.

    An existing file is replaced only when the new one is complete.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    content: dict[str, Any] = {
        "format": np.array(f"kinarm-{kind.replace(' ', '-')}"),
        "version": np.array(version),
        "header": np.array(json.dumps(header, sort_keys=True)),
        **arrays,
    }
    write = np.savez_compressed if compress else np.savez
    write_atomically(path, lambda file: write(file, **content))


def load_archive(path: str | Path, kind: str, version: int, error: type[KinarmError]) -> Archive:
    """Read what `save_archive` wrote.

    Raises
    ------
    KinarmError
        Of the given type, in one line: if the file is missing, damaged, holds something else, or
        was written by a version of kinarm whose format is another.
    """
    name, wanted = repr(str(path)), f"kinarm-{kind.replace(' ', '-')}"
    with reading(name, kind, error), Path(path).open("rb") as file:
        content = np.load(file, allow_pickle=False)
        if not isinstance(content, np.lib.npyio.NpzFile) or "format" not in content:
            raise error(f"{name} is not a kinarm {kind}")
        held = str(content["format"])
        if held != wanted:
            raise error(f"{name} holds {held[:40]!r}, not {wanted!r}")
        found = int(content["version"])
        if found != version:
            age = "a later" if found > version else "an earlier"
            raise error(
                f"{name} has format version {found}, of {age} kinarm; this one reads {version}"
            )
        header = json.loads(str(content["header"]))
        if not isinstance(header, dict):
            raise error(f"{name} is not a complete kinarm {kind}: its header is no table")
        skip = ("format", "version", "header")
        return Archive(header, {key: content[key] for key in content.files if key not in skip})


@contextmanager
def reading(
    name: str, kind: str, error: type[KinarmError], *, of: str = "kinarm"
) -> Iterator[None]:
    """Turn what reading a damaged file raises, or making something of it, into one line.

    The name of the file comes quoted; errors of the given type pass as they are.
    """
    try:
        yield
    except (error, AssertionError):
        raise
    except OSError as problem:
        raise error(f"cannot read {kind} {name}: {problem.strerror}") from problem
    except Exception as problem:  # a damaged file can raise anything
        raise error(f"{name} is not a complete {of} {kind}: {first_line(problem)}") from problem
