"""Mesh files of robot descriptions as painted, simplified triangles; read once, then cached."""

import json
import logging
from collections.abc import Sequence
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm._files import cached_arrays, first_line
from kinarm.errors import ArmError, MissingExtraError
from kinarm.meshes import mesh_content
from kinarm.urdf_tree import FARTHEST
from kinarm.viewer.meshes import Mesh
from kinarm.viewer.parts import packed_colour

TOLERANCE = 3e-4
"""How far a simplified surface may lie from the planes of the triangles that it replaces [m]."""

UNKNOWN = -1
"""Stands for a colour that a file does not state."""

VERSION = 1
"""Of what is kept of a file; to be raised when the same file makes other triangles."""

logging.getLogger("trimesh").addHandler(logging.NullHandler())  # else it prints its warnings

READERS = ("trimesh", "pycollada", "fast-simplification")
"""Packages of the extra ``robots`` that meshes are read and simplified with."""

UNIVERSAL_ROBOTS = np.array(
    [(0.49, 0.678, 0.8), (0.82, 0.82, 0.82), (0.279, 0.279, 0.279), (0.58, 0.58, 0.58), (0.1,) * 3]
)
"""Colours of the maker's caps, links, joints, rims and seals."""

DIMMING, MOST_TIMES, SAME_COLOUR = 0.8, 6, 0.003
"""The meshes in ``ur_description`` went through a modeller a few times, each of which left them
this share of their light; links that went through it more often than others look darker."""


class PaintedMesh(NamedTuple):
    """Triangles of one material, whose colour is 0xRRGGBB, or None if the file does not say."""

    mesh: Mesh
    colour: int | None


def read_mesh_file(path: Path, scale: Sequence[float]) -> tuple[PaintedMesh, ...]:
    """Read a mesh file and simplify it; or look up what came of it before.

    Nodes are placed and units converted as the file says. Its up axis counts for nothing, as in
    ROS and in Pinocchio, so that looks and collision shapes agree. ``scale`` are factors along the
    axes.

    Raises
    ------
    MissingExtraError
        If the extra ``robots`` is not installed.
    ArmError
        If the file cannot be read.
    """
    content = mesh_content(path)
    made_with = json.dumps([path.suffix, list(scale), TOLERANCE, _versions()])
    made_of = made_with.encode() + content
    arrays = cached_arrays("mesh", VERSION, made_of, lambda: _simplified_arrays(path, scale))
    return tuple(
        PaintedMesh(
            Mesh(*(arrays[f"{name} {number}"] for name in ("vertices", "faces", "normals"))),
            None if colour == UNKNOWN else int(colour),
        )
        for number, colour in enumerate(arrays["colours"])
    )


@cache
def _versions() -> list[str]:
    """Versions of the packages that meshes are read and simplified with."""
    try:
        return [metadata.version(name) for name in READERS]
    except metadata.PackageNotFoundError as error:
        raise MissingExtraError(str(error.name), "robots") from error


def _simplified_arrays(path: Path, scale: Sequence[float]) -> dict[str, ArrayLike]:
    """Triangles and colours of a file, as they are kept."""
    pieces = _pieces(path, scale)
    colours = [UNKNOWN if piece.colour is None else piece.colour for piece in pieces]
    arrays: dict[str, ArrayLike] = {"colours": colours}
    for number, piece in enumerate(pieces):
        vertices, normals, faces = _simplified(piece.mesh).with_normals()
        made = {"vertices": vertices, "normals": normals, "faces": faces}
        arrays |= {f"{name} {number}": array for name, array in made.items()}
    return arrays


@np.errstate(all="ignore")  # what is not finite is refused at its end
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
    for piece in pieces:
        farthest = np.abs(piece.mesh.vertices).max()
        if not farthest <= FARTHEST:
            raise ArmError(f"mesh {path.name!r} has a vertex {farthest:g} m away")
    return pieces


def _placed(geometry: Any, transform: NDArray[np.float64], scale: Sequence[float]) -> Mesh:
    """Triangles of a geometry where a node puts it."""
    unit = str(geometry.metadata.get("units", "")).partition(" * ")  # "0.001 * meters", or none
    factors = (float(unit[0]) if unit[1] else 1.0) * np.asarray(scale, dtype=float)
    stretch = factors[:, None] * transform[:3, :3]
    mirrored = np.linalg.det(stretch) < 0  # which turns triangles inside out
    faces = geometry.faces[:, ::-1] if mirrored else geometry.faces
    return Mesh(geometry.vertices, faces).moved(factors * transform[:3, 3], stretch)


def _colour(geometry: Any, path: Path) -> int | None:
    """Colour of a geometry as 0xRRGGBB; None if the file does not say."""
    look = geometry.visual
    if look.kind is None:
        return None
    colour = (look.material if look.kind == "texture" else look).main_color
    return packed_colour(original_colour(path, np.asarray(colour[:3]) / 255))


def original_colour(path: Path, colour: NDArray[np.float64]) -> NDArray[np.float64]:
    """Colour of a part as its maker made it, shape (3,), for one that a mesh file states."""
    if "ur_description" in path.parts:
        for times in range(MOST_TIMES + 1):
            apart = np.abs(UNIVERSAL_ROBOTS * DIMMING**times - colour).max(axis=1)
            if apart.min() < SAME_COLOUR:
                return np.array(UNIVERSAL_ROBOTS[apart.argmin()])
    return colour


def _simplified(mesh: Mesh) -> Mesh:
    """Fewer triangles within `TOLERANCE`; open edges stay as they are."""
    import fast_simplification

    welded = mesh.welded()
    # Without loss means for this package that the squared distances of a corner from the planes
    # that meet there sum up to less than this.
    unit = TOLERANCE / np.sqrt(np.finfo(float).eps)
    places, corners = welded.vertices / unit, welded.faces.astype(np.int32)
    simplify = fast_simplification.simplify
    vertices, faces = simplify(places, corners, lossless=True, preserve_border=True)
    return Mesh(vertices * unit, faces.astype(np.int64))
