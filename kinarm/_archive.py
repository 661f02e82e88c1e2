"""The only reader of files with results: ``.npz`` with a header in JSON, without pickle; JSON."""

import json
import math
import os
import warnings
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm._files import first_line, read_file, write_atomically
from kinarm.errors import KinarmError

KINDS = "biufU"
"""Kinds of what an array may hold: truth values, whole numbers, numbers and texts."""

GROWTH, SLACK = 4, 50 * 10**6
"""How much larger than its file what is read may be: by a factor, and a number of bytes."""

JSON_SIZES = {"[": 90, "{": 200, ",": 36, '"': 26}
"""Memory that a value takes at most for each of its signs [bytes]."""

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
    write_atomically(
        path, lambda file: write_archive(file, kind, version, arrays, header, compress=compress)
    )


def write_archive(
    file: IO[bytes],
    kind: str,
    version: int,
    arrays: Arrays,
    header: Mapping[str, Any],
    *,
    compress: bool = False,
) -> None:
    """Write what `save_archive` does to an open file."""
    content: dict[str, Any] = {
        "format": np.array(f"kinarm-{kind.replace(' ', '-')}"),
        "version": np.array(version),
        "header": np.array(json.dumps(header, sort_keys=True)),
        **arrays,
    }
    # What is larger could not be told from a small file that claims to hold much.
    small = sum(array.nbytes for array in arrays.values()) < SLACK
    write = np.savez_compressed if compress and small else np.savez
    write(file, **content)


def load_archive(
    path: str | Path,
    kind: str,
    version: int,
    error: type[KinarmError],
    *,
    unless: tuple[str, ...] = (),
) -> Archive:
    """Read what `save_archive` wrote, but for arrays whose names begin as those in ``unless``.

    Raises
    ------
    KinarmError
        Of the given type, in one line: if the file is missing, damaged, holds something else, or
        was written by a version of kinarm whose format is another.
    """
    name, wanted = repr(str(path)), f"kinarm-{kind.replace(' ', '-')}"
    with reading(name, kind, error), Path(path).open("rb") as file:
        is_other = file.read(2) not in (b"", b"PK")
        content = {} if is_other else _arrays(file, unless)
        if "format" not in content:
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
        header = parse_json(str(content["header"]))
        if not isinstance(header, dict):
            raise error(f"{name} is not a complete kinarm {kind}: its header is no table")
        skip = ("format", "version", "header")
        return Archive(header, {key: content[key] for key in content if key not in skip})


def load_json(path: str | Path, kind: str, error: type[KinarmError]) -> Any:
    """Read a JSON document.

    Raises
    ------
    KinarmError
        Of the given type, in one line: if the file is missing or no JSON.
    """
    with reading(repr(str(path)), kind, error):
        return parse_json(read_file(path).decode())


def parse_json(text: str) -> Any:
    """The value of a JSON document, if it takes little more memory than the document.

    Raises
    ------
    ValueError
        If it is no JSON, or takes more than `GROWTH` and `SLACK` allow.
    """
    memory = len(text) + sum(size * text.count(sign) for sign, size in JSON_SIZES.items())
    if memory > GROWTH * len(text) + SLACK:
        raise ValueError(f"it would take {memory / 1e6:.0f} MB of memory")
    return json.loads(text)


def _arrays(file: IO[bytes], unless: tuple[str, ...]) -> dict[str, NDArray[Any]]:
    """Arrays of a ``.npz`` file, but for those whose names begin as some.

    Whatever it claims to hold, little more than its size is read.
    """
    arrays: dict[str, NDArray[Any]] = {}
    with warnings.catch_warnings(action="ignore"), zipfile.ZipFile(file) as archive:
        members = archive.infolist()
        claimed = sum(member.file_size for member in members)
        if claimed > GROWTH * os.fstat(file.fileno()).st_size + SLACK:
            raise ValueError(f"it claims to hold {claimed / 1e6:.0f} MB")
        for member in members:
            if unless and member.filename.startswith(unless):
                continue
            with archive.open(member) as stored:
                arrays[member.filename.removesuffix(".npy")] = _array(stored, member)
    return arrays


def _array(stored: IO[bytes], member: zipfile.ZipInfo) -> NDArray[Any]:
    """Read one array, if it is of numbers or texts and as large as its file."""
    version = np.lib.format.read_magic(stored)
    read_header = getattr(np.lib.format, f"read_array_header_{version[0]}_0")
    shape, by_column, dtype = read_header(stored)
    size = math.prod(shape) * dtype.itemsize
    if dtype.kind not in KINDS or min(shape, default=0) < 0:
        raise ValueError(f"{member.filename} holds {dtype}")
    if size != member.file_size - stored.tell():
        raise ValueError(f"{member.filename} does not hold {shape} values")
    array = np.frombuffer(stored.read(size), dtype=dtype) if size else np.empty(0, dtype)
    return array.reshape(shape, order="F" if by_column else "C").copy()


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
