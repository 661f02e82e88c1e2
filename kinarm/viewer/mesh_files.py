"""Mesh files of robot descriptions as painted, simplified triangles; read once, then cached."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from contextlib import suppress
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm._archive import load_archive, save_archive
from kinarm._cache import cache_folder, delete_least_recently_used
from kinarm._files import check_folder, first_line
from kinarm.errors import ArmError, InvalidInputError, MissingExtraError, OutputError
from kinarm.viewer.finishes import original_colour, packed_colour
from kinarm.viewer.meshes import Mesh

TOLERANCE = 3e-4
"""How far a simplified surface may lie from the planes of the triangles that it replaces [m]."""

ARCHIVE = ("mesh", 1)
"""Kind and version of the cached files; to be raised when what is read or made changes."""

ARRAYS = ("vertices", "faces", "normals")
"""What they hold of each piece, by number."""

KEPT_FILES, KEPT_BYTES = 500, 128 * 2**20
"""Mesh files whose triangles are kept, and how large they may be together."""

READERS = ("trimesh", "pycollada", "fast-simplification")
"""Packages of the extra ``robots`` that meshes are read and simplified with."""


class PaintedMesh(NamedTuple):
    """Triangles of one material.

    Attributes
    ----------
    mesh : Mesh
        Its triangles, in the frame of the file [m, if that says so].
    colour : int or None
        Red, green and blue as 0xRRGGBB; None if the file does not say.
    """

    mesh: Mesh
    colour: int | None


def read_mesh_file(path: Path, scale: Sequence[float]) -> tuple[PaintedMesh, ...]:
    """Read a mesh file and simplify it; or look up what came of it before.

    Nodes are placed and units converted as the file says. Its up axis counts for nothing, as in
    ROS and in Pinocchio, so that looks and collision shapes agree.

    Parameters
    ----------
    path : Path
        A file that trimesh reads: Collada, STL, OBJ, ...
    scale : sequence of float
        Factors along the axes.

    Raises
    ------
    MissingExtraError
        If the extra ``robots`` is not installed.
    ArmError
        If the file cannot be read.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ArmError(f"cannot read mesh {path.name!r}: {error.strerror}") from error
    cached = cache_folder() / f"mesh-{_digest(content, path.suffix, scale)}.npz"
    found = _load(cached)
    if found is None:
        found = tuple(
            PaintedMesh(_simplified(piece.mesh), piece.colour) for piece in _pieces(path, scale)
        )
        _save(cached, found)
    return found


def _digest(content: bytes, suffix: str, scale: Sequence[float]) -> str:
    """Hash of what triangles are made of and with."""
    try:
        versions = [metadata.version(name) for name in READERS]
    except metadata.PackageNotFoundError as error:
        raise MissingExtraError(str(error.name), "robots") from error
    made_with = json.dumps([suffix, list(scale), TOLERANCE, versions])
    return hashlib.sha256(made_with.encode() + content).hexdigest()[:24]


def _pieces(path: Path, scale: Sequence[float]) -> list[PaintedMesh]:
    """Triangles of a file by node and material."""
    import trimesh

    try:
        scene = trimesh.load_scene(path, process=False)
        nodes = [scene.graph[node] for node in sorted(scene.graph.nodes_geometry)]
        pieces = [
            PaintedMesh(
                _placed(scene.geometry[name], transform, scale), _colour(scene.geometry[name], path)
            )
            for transform, name in nodes
            if len(getattr(scene.geometry[name], "faces", ()))
        ]
    except Exception as error:  # a damaged file can raise anything
        raise ArmError(f"mesh {path.name!r} cannot be read: {first_line(error)}") from error
    if not pieces:
        raise ArmError(f"mesh {path.name!r} has no triangles")
    return pieces


def _placed(geometry: Any, transform: NDArray[np.float64], scale: Sequence[float]) -> Mesh:
    """Triangles of a geometry where a node puts it."""
    factors = _unit(geometry) * np.asarray(scale, dtype=float)
    stretch = factors[:, None] * transform[:3, :3]
    mirrored = np.linalg.det(stretch) < 0  # which turns triangles inside out
    faces = geometry.faces[:, ::-1] if mirrored else geometry.faces
    return Mesh(geometry.vertices, faces).moved(factors * transform[:3, 3], stretch)


def _unit(geometry: Any) -> float:
    """Unit of length of a geometry [m]; files that name none are in metres."""
    factor = str(geometry.metadata.get("units", "")).partition(" * ")[0]
    try:
        return float(factor)
    except ValueError:
        return 1.0


def _colour(geometry: Any, path: Path) -> int | None:
    """Colour of a geometry as 0xRRGGBB; None if the file does not say."""
    look = geometry.visual
    if look.kind is None:
        return None
    colour = (look.material if look.kind == "texture" else look).main_color
    return packed_colour(original_colour(path, np.asarray(colour[:3]) / 255))


def _simplified(mesh: Mesh) -> Mesh:
    """Fewer triangles within `TOLERANCE`, with normals; open edges stay as they are."""
    import fast_simplification

    welded = mesh.welded()
    # Without loss means for this package that the squared distances of a corner from the planes
    # that meet there sum up to less than this.
    unit = TOLERANCE / np.sqrt(np.finfo(float).eps)
    vertices, faces = fast_simplification.simplify(
        welded.vertices / unit,
        welded.faces.astype(np.int32),
        lossless=True,
        preserve_border=True,
    )
    corners, normals, faces = Mesh(vertices * unit, faces.astype(np.int64)).with_normals()
    return Mesh(corners, faces, normals)


def _load(path: Path) -> tuple[PaintedMesh, ...] | None:
    """Look up triangles; None if there are none or they cannot be used."""
    try:
        archive = load_archive(path, *ARCHIVE, InvalidInputError)
        return tuple(
            PaintedMesh(Mesh(*(archive.arrays[f"{name} {number}"] for name in ARRAYS)), colour)
            for number, colour in enumerate(archive.header["colours"])
        )
    except (InvalidInputError, KeyError):
        return None


def _save(path: Path, pieces: Sequence[PaintedMesh]) -> None:
    """Keep triangles, if possible, and make room for them."""
    arrays = {
        f"{name} {number}": getattr(piece.mesh, name)
        for number, piece in enumerate(pieces)
        for name in ARRAYS
    }
    with suppress(OutputError):
        check_folder(path.parent)
        header = {"colours": [piece.colour for piece in pieces]}
        save_archive(path, *ARCHIVE, arrays, header)
        delete_least_recently_used(path.parent, "mesh", KEPT_FILES, KEPT_BYTES)
