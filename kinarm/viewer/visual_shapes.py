"""The looks of an arm: triangles that ship with it, else the shapes of its URDF.

Meshes are painted, simplified triangles; a file is read once, then cached.
"""

import json
import logging
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from functools import cache, lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from kinarm._files import absolute, cached_arrays, first_line, load_archive, shipped_files
from kinarm.arm import Arm
from kinarm.contact_pairs import body_names
from kinarm.errors import ArmError, KinarmError, MissingExtraError
from kinarm.meshes import mesh_content
from kinarm.urdf_tree import FARTHEST, check_numbers, check_shapes
from kinarm.viewer.meshes import Mesh, from_coal
from kinarm.viewer.parts import FINISHES, PLAIN, ArmPart, Finish, packed_colour, shape_finish

Element = ElementTree.Element

LOOKS = ("looks", 1)
"""Kind and version of the files of looks, which ``docs/make_arm_looks.py`` makes."""

TOOL_RADIUS = 0.012
"""Radius of the tool's ball; for a reach below 1 m, times the reach [m]."""

TOLERANCE = 3e-4
"""Distance of a simplified surface from the former triangles' planes [m]."""

UNKNOWN = -1
"""A colour that a file does not state."""

VERSION = 1
"""To be raised when the same file makes other triangles."""

logging.getLogger("trimesh").addHandler(logging.NullHandler())  # else it prints its warnings

READERS = ("trimesh", "pycollada", "fast-simplification")
"""Packages of the extra ``robots`` that read and simplify meshes."""


class PaintedMesh(NamedTuple):
    """Triangles of one material with its colour 0xRRGGBB, None if unstated."""

    mesh: Mesh
    colour: int | None


def grouped_parts(arm: Arm) -> dict[tuple[int, Finish], list[Mesh]]:
    """Meshes of an arm by joint and finish."""
    groups: dict[tuple[int, Finish], list[Mesh]] = defaultdict(list)
    for part in arm_parts(arm):
        groups[part.joint, part.finish].append(part.mesh)
    return groups


@lru_cache(maxsize=8)
def arm_parts(arm: Arm) -> tuple[ArmPart, ...]:
    """All parts of an arm, and what it holds.

    The project's own arms have looks that ship with them. Any other arm shows the visual shapes of
    its URDF, or its collision shapes where none can be read, which is logged.
    """
    n_held = len(arm.held_bodies)
    held = collision_parts(arm)[-n_held:] if n_held else ()
    if stored := tuple(stored_parts(arm)):
        return (*stored, *held)
    try:
        found = tuple(visual_parts(arm))
    except KinarmError as error:
        logging.getLogger(__name__).warning(
            "%s is shown by its collision shapes: %s", arm.name, error
        )
        found = ()
    tool = from_coal(coal.Sphere(TOOL_RADIUS * min(arm.reach, 1.0))).moved(arm.chain.tool)
    parts = (*found, *held) if found else collision_parts(arm)
    return (*parts, ArmPart(arm.n_joints, FINISHES["accent"], tool))


def stored_parts(arm: Arm) -> Iterator[ArmPart]:
    """Parts that ship beside the URDF of an arm, if it has their joints and tool."""
    looks = arm.description.path.with_suffix(".npz")
    if looks not in map(absolute, shipped_files("arms", ".npz").values()):
        return
    header, arrays = load_archive(looks, *LOOKS, ArmError)
    if [*arm.joint_names] != header["names"] or not np.allclose(arm.chain.tool, header["tool"]):
        return
    base = arm.model.frames[1].placement  # of the link fixed in the world
    for number, joint in enumerate(arrays["joints"].tolist()):
        mesh = Mesh(arrays[f"vertices {number}"], arrays[f"faces {number}"])
        placed = mesh if joint else mesh.moved(base.translation, base.rotation)
        yield ArmPart(joint, FINISHES[arrays["finishes"][number]], placed)


def collision_parts(arm: Arm) -> tuple[ArmPart, ...]:
    """The shapes that decide about contact, in colours of our own."""
    return tuple(
        _placed_part(shape.parentJoint, None, from_coal(shape.geometry), shape.placement)
        for shape in arm.geometry.geometryObjects
    )


def _placed_part(joint: int, colour: int | None, mesh: Mesh, placement: pin.SE3) -> ArmPart:
    """A shape on a joint; without colours, links alternate two."""
    finish = PLAIN[joint % len(PLAIN)] if colour is None else shape_finish(colour)
    return ArmPart(joint, finish, mesh.moved(placement.translation, placement.rotation))


def link_joints(arm: Arm) -> dict[str, int]:
    """Joint that carries each link with a collision shape; 0 is the base."""
    shapes = arm.geometry.geometryObjects
    return {name: shape.parentJoint for name, shape in zip(body_names(arm), shapes, strict=True)}


def visual_parts(arm: Arm) -> Iterator[ArmPart]:
    """Visual shapes of an arm's URDF where Pinocchio puts them, simplified where they are meshes.

    A mesh of several colours keeps them; else the URDF's colour takes precedence. Raises
    KinarmError if a shape is damaged or needs the missing extra ``robots``.
    """
    robot = ElementTree.fromstring(arm.description.text)
    robot.attrib = {"name": "robot", "version": "1.2"}
    named = {look.get("name"): look for look in reversed(robot.findall(".//material[color]"))}
    stated, meshes = dict[str, int | None](), dict[str, tuple[PaintedMesh, ...]]()
    for link in robot.findall("link"):
        check_shapes(link, "visual")
        for number, visual in enumerate(link.findall("visual")):
            name, mesh = f"{link.get('name')}_{number}", visual.find("geometry/mesh")
            stated[name] = _stated_colour(visual, named)
            if mesh is not None:
                scale = tuple(map(float, mesh.attrib["scale"].split()))
                meshes[name] = read_mesh_file(Path(mesh.get("filename", "")), scale)
                mesh.tag, mesh.attrib = "sphere", {"radius": "1"}
    for parent in (robot, *robot.iter("visual")):
        for look in parent.findall("material"):  # about which Pinocchio may print errors
            parent.remove(look)
    text = ElementTree.tostring(robot, "unicode")
    geometry = pin.buildGeomFromUrdfString(arm.model, text, pin.GeometryType.VISUAL)
    for shape in geometry.geometryObjects:
        pieces = meshes.get(shape.name) or [PaintedMesh(from_coal(shape.geometry), None)]
        whole = stated[shape.name] if len({piece.colour for piece in pieces}) == 1 else None
        for piece in pieces:
            colour = piece.colour if whole is None else whole
            yield _placed_part(shape.parentJoint, colour, piece.mesh, shape.placement)


def _stated_colour(visual: Element, named: Mapping[str | None, Element]) -> int | None:
    """Colour of a visual shape's material as 0xRRGGBB, or of the one of its name, or None."""
    look = visual.find("material")
    if look is not None and look.find("color") is None:
        look = named.get(look.get("name"))
    colour = None if look is None else look.find("color")
    if colour is None:
        return None
    check_numbers(colour, "a visual shape")
    return packed_colour([float(word) for word in colour.attrib["rgba"].split()[:3]])


def read_mesh_file(path: Path, scale: Sequence[float]) -> tuple[PaintedMesh, ...]:
    """Read a mesh file and simplify it, or look it up in the cache.

    Nodes are placed and units converted as the file says, without its up axis, as in ROS and
    Pinocchio, so that looks and collision shapes agree. ``scale`` are factors along the axes.
    Raises MissingExtraError if the extra ``robots`` is not installed, and ArmError if the file
    cannot be read.
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
    """Versions of `READERS`."""
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
    """Triangles of a file by node and material.

    Coal 3, through which Pinocchio reads meshes, joins wrong vertices in the triangles of a Collada
    node that has several materials, or nodes within.
    """
    import trimesh

    try:
        scene = trimesh.load_scene(path, process=False)
        nodes = [scene.graph[node] for node in sorted(scene.graph.nodes_geometry)]
        pieces = [
            PaintedMesh(
                _placed(scene.geometry[name], transform, scale), _colour(scene.geometry[name])
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


def _colour(geometry: Any) -> int | None:
    """Colour of a geometry as 0xRRGGBB, or None."""
    look = geometry.visual
    if look.kind is None:
        return None
    colour = (look.material if look.kind == "texture" else look).main_color
    return packed_colour(np.asarray(colour[:3]) / 255)


def _simplified(mesh: Mesh) -> Mesh:
    """Fewer triangles within `TOLERANCE`; open edges stay as they are."""
    import fast_simplification

    welded = mesh.welded()
    # To this package, lossless means that the squared distances of a corner from the planes that
    # meet there sum up to less than this.
    unit = TOLERANCE / np.sqrt(np.finfo(float).eps)
    places, corners = welded.vertices / unit, welded.faces.astype(np.int32)
    simplify = fast_simplification.simplify
    vertices, faces = simplify(places, corners, lossless=True, preserve_border=True)
    return Mesh(vertices * unit, faces.astype(np.int64))
