"""What a mesh file holds, before libraries in C++ are let at it."""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinarm._files import first_line, read_file
from kinarm.errors import ArmError
from kinarm.urdf_schema import FARTHEST
from kinarm.xml_files import parse_xml

FORMATS = (".dae", ".obj", ".stl")
"""Endings of files that are read."""

INDEX_TAGS = ("p", "h", "v", "vcount", "int_array")
NUMBER_TAGS = ("float_array", "matrix", "translate", "rotate", "scale", "skew", "lookat", "color")
"""Elements of Collada that hold numbers, whole or not."""

COUNTS = ("count", "offset", "stride", "set")
"""Attributes of Collada that are whole numbers, none of them negative."""

COUNT = re.compile(r"\s*\d{1,9}\s*")
INDICES = re.compile(r"\s*(?:-?\d{1,9}(?:\s+|$))*")
NUMBERS = re.compile(r"\s*(?:[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?:\s+|$))*")

FLAT = 1e-9
"""Thickness over width of what has no volume."""

LARGEST = 200 * 10**6
"""Size of a mesh file at most [bytes]."""


def mesh_content(path: Path) -> bytes:
    """Read a mesh file, of which nothing is known yet but that it claims no more than it holds.

    Raises
    ------
    ArmError
        If it cannot be read, is of another format, or claims more than it holds.
    """
    if path.suffix.lower() not in FORMATS:
        raise ArmError(f"mesh {path.name!r} must be a file of {', '.join(FORMATS)}")
    try:
        content = read_file(path, LARGEST)
        if path.suffix.lower() == ".dae":
            _check_collada(content)
    except OSError as error:
        raise ArmError(f"cannot read mesh {path.name!r}: {error.strerror}") from error
    except ValueError as error:
        raise ArmError(f"mesh {path.name!r} cannot be read: {first_line(error)}") from error
    return content


def _check_collada(content: bytes) -> None:
    """Refuse a Collada file without numbers where they belong: Assimp hangs or ends the process."""
    for element in parse_xml(content).iter():
        tag = element.tag.rpartition("}")[2]
        for name in COUNTS:
            if not COUNT.fullmatch(element.get(name, "0")):
                raise ValueError(f"{name} of <{tag}> is no whole number of at least 0")
        pattern = INDICES if tag in INDEX_TAGS else NUMBERS if tag in NUMBER_TAGS else None
        if pattern is not None and not pattern.fullmatch(element.text or ""):
            raise ValueError(f"<{tag}> holds what is no number")


def check_vertices(path: Path, vertices: NDArray[np.float64]) -> None:
    """Refuse a mesh whose vertices, shape (n, 3), span no volume or are too far away [m].

    Raises
    ------
    ArmError
        If they do.
    """
    farthest = np.abs(vertices).max(initial=0.0)
    if not farthest <= FARTHEST:
        raise ArmError(f"mesh {path.name!r} has a vertex {farthest:g} m away")
    extents = np.linalg.svd(vertices - vertices.mean(axis=0), compute_uv=False)
    if len(extents) < 3 or extents[2] <= FLAT * extents[0]:
        raise ArmError(f"mesh {path.name!r} has no volume")
