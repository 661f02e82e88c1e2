"""The only reader and writer of ``.npz`` files: a header in JSON and arrays, without pickle."""

import json
import lzma
import tokenize
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm._files import first_line, write_atomically
from kinarm.errors import KinarmError

Arrays = Mapping[str, NDArray[Any]]

CORRUPT = (
    ArithmeticError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    RuntimeError,
    SyntaxError,
    TypeError,
    ValueError,
    lzma.LZMAError,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)
"""What reading a damaged file raises, or making something of what it holds."""


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
    """Write arrays and a header; an existing file is replaced only when the new one is complete.

    Parameters
    ----------
    path : str or Path
        The file; its folder must exist.
    kind : str
        What it holds, such as ``"policy"``.
    version : int
        Version of the format of this kind.
    arrays : mapping of str to ndarray
        Arrays by name.
    header : mapping
        What JSON can hold.
    compress : bool
        Whether the arrays are worth compressing.

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

    Parameters
    ----------
    path : str or Path
        The file.
    kind : str
        What it should hold.
    version : int
        The version that can be read.
    error : type
        What to raise.

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
def reading(name: str, kind: str, error: type[KinarmError]) -> Iterator[None]:
    """Turn what reading a damaged file raises into one line.

    Parameters
    ----------
    name : str
        Name of the file, quoted.
    kind : str
        What it should hold.
    error : type
        What to raise; errors of this type pass as they are.
    """
    try:
        yield
    except error:
        raise
    except OSError as problem:
        raise error(f"cannot read {kind} {name}: {problem.strerror}") from problem
    except (KinarmError, *CORRUPT) as problem:
        reason = first_line(problem)
        raise error(f"{name} is not a complete kinarm {kind}: {reason}") from problem
