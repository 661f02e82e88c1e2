"""Mesh files: paths, content, and convex hulls, which are never too small."""

import itertools
import re
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import coal
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import HalfspaceIntersection

from kinarm._files import Arrays, absolute, cached_arrays, first_line, is_file
from kinarm.errors import ArmError, finite_array
from kinarm.pieces import cut_into_pieces
from kinarm.urdf_tree import FARTHEST, parse_xml

if TYPE_CHECKING:
    from kinarm.bodies import Body

FORMATS = (".dae", ".obj", ".stl")
"""Endings of readable files."""

INDEX_TAGS = ("p", "h", "v", "vcount", "int_array")
NUMBER_TAGS = ("float_array", "matrix", "translate", "rotate", "scale", "skew", "lookat", "color")
"""Elements of Collada with whole and other numbers."""

COUNTS = ("count", "offset", "stride", "set")
"""Attributes of Collada that are whole numbers of at least 0."""

INDICES = re.compile(r"\s*(?:-?\d{1,9}(?:\s+|$))*")
NUMBERS = re.compile(r"\s*(?:[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?:\s+|$))*")

FLAT = 1e-6
"""Thickness over width of what has no volume, as of `kinarm.Body`."""

VERSION = 2
"""To be raised when the same mesh gets other hulls."""

MANY_VERTICES = 1000
"""Vertices above which a simpler hull takes its place."""

PLANES = 160
"""Faces of such a hull at most; vertices are twice as many less four."""

CONVEX = 0.02
"""Share by which the hull of a mesh may be larger if the mesh counts as convex."""

EXCESS = 1e-4
"""Depth of a corner up to which it is not cut off [m]."""

GRID = 1e-9
"""Unit of normals and offsets [1 and m], so that machines agree."""


def resolve_meshes(robot: ElementTree.Element, path: Path, folders: Collection[str]) -> None:
    """Replace mesh names in a URDF by paths.

    Raises ArmError if a mesh that can touch something is missing.

    Parameters
    ----------
    robot, path
        Root and file of the URDF.
    folders : collection of str
        Folders of packages, beside those around the file.
    """
    for use in ("collision", "visual"):
        for mesh in robot.findall(f"link/{use}/geometry/mesh"):
            name = mesh.get("filename", "")
            found = _mesh_path(name, path, folders)
            if found is not None:
                mesh.set("filename", str(found))
            elif use == "collision":
                raise ArmError(
                    f"mesh {name!r} is not found; package_dirs holds folders of package:// meshes"
                )


def _mesh_path(name: str, path: Path, folders: Collection[str]) -> Path | None:
    """Find a mesh in package folders, or around the URDF."""
    scheme, separator, inside = name.partition("://")
    if scheme == "file":
        return Path(inside) if is_file(inside) else None
    if separator:
        around = (*map(Path, folders), *path.parents)
        package = inside.partition("/")[0]
        own = (folder.parent for folder in around if folder.name == package)
        places = [folder / inside for folder in (*around, *own)]
    else:
        places = [path.parent / name]
    return next((absolute(place) for place in places if is_file(place)), None)


def mesh_content(path: Path) -> bytes:
    """Read a mesh file; its claims of how much it holds are checked.

    Raises ArmError if they are false, or the file is unreadable or of another format.
    """
    if path.suffix.lower() not in FORMATS:
        raise ArmError(f"mesh {path.name!r} must be a file of {', '.join(FORMATS)}")
    try:
        content = path.read_bytes()
        if path.suffix.lower() == ".dae":
            _check_collada(content)
    except OSError as error:
        raise ArmError(f"cannot read mesh {path.name!r}: {error.strerror}") from error
    except ValueError as error:
        raise ArmError(f"mesh {path.name!r} cannot be read: {first_line(error)}") from error
    return content


def _check_collada(content: bytes) -> None:
    """Refuse a Collada file of bad numbers: Assimp hangs or ends the process."""
    for element in parse_xml(content).iter():
        tag = element.tag.rpartition("}")[2]
        for name in COUNTS:
            given = element.get(name, "0").strip()
            if not (re.fullmatch(r"\d{1,9}", given) and int(given) <= len(content)):
                raise ValueError(f"{name} of <{tag}> is no count of what the file can hold")
        pattern = INDICES if tag in INDEX_TAGS else NUMBERS if tag in NUMBER_TAGS else None
        if pattern is not None and not pattern.fullmatch(element.text or ""):
            raise ValueError(f"<{tag}> holds what is no number")


def check_vertices(path: Path, vertices: NDArray[np.float64]) -> None:
    """Refuse vertices, shape (n, 3), without volume or too far away [m]."""
    farthest = np.abs(vertices).max(initial=0.0)
    if not farthest <= FARTHEST:
        raise ArmError(f"mesh {path.name!r} has a vertex {farthest:g} m away")
    extents = np.linalg.svd(vertices - vertices.mean(axis=0), compute_uv=False)
    if len(extents) < 3 or extents[2] <= FLAT * extents[0]:
        raise ArmError(f"mesh {path.name!r} has no volume")


def hulls_of_mesh(path: Path, scale: NDArray[np.float64], count: int = 1) -> list[coal.ConvexBase]:
    """Convex hulls of a mesh file, or of the pieces that it is cut into.

    A hull of many corners is replaced by a simpler polytope around it. Corners are cached. Raises
    ArmError if the file is no readable mesh.

    Parameters
    ----------
    path : Path
        The file.
    scale : ndarray, shape (3,)
        Factors along its axes.
    count : int
        Pieces at most.
    """
    content = bytes([count]) + scale.tobytes() + mesh_content(path)
    arrays = cached_arrays("hull", VERSION, content, lambda: _corners(path, scale, count))
    return [convex_hull(arrays[str(number)]) for number in range(len(arrays))]


def _corners(path: Path, scale: NDArray[np.float64], count: int) -> Arrays:
    """Corners of each hull, or of a polytope around it, by its number."""
    try:
        mesh = coal.MeshLoader(coal.BV_AABB).load(str(path), scale)
        vertices = mesh.vertices()
        check_vertices(path, vertices)
        pieces = [vertices]
        if count > 1:
            faces = map(mesh.tri_indices, range(mesh.num_tris))
            corners = np.array([[face[corner] for corner in range(3)] for face in faces])
            pieces = cut_into_pieces(vertices[corners], count)
        hulls = [np.array(convex_hull(piece).points()) for piece in pieces]
        return {
            str(number): enclosing_corners(hull) if len(hull) > MANY_VERTICES else hull
            for number, hull in enumerate(hulls)
        }
    except (ValueError, RuntimeError) as error:
        # Coal's reason comes after the place in its sources.
        reason = str(error).rpartition("message: ")[2]
        raise ArmError(f"mesh {path.name!r} cannot be loaded: {reason}") from error


def convex_hull(points: NDArray[np.float64]) -> coal.ConvexBase:
    """Convex hull of points, shape (n, 3), in Coal."""
    listed = coal.StdVec_Vec3s()
    listed.extend(points)
    return coal.Convex.convexHull(listed, True, "Qt")


def mesh_vertices(
    path: str | Path, *, scale: float = 1.0, hull: bool = False
) -> NDArray[np.float64]:
    """Vertices of a convex mesh file, for a `kinarm.bodies.Body`, shape (n, 3) [m].

    Those of very many are replaced by a simpler polytope around them.

    Parameters
    ----------
    path : str or Path
        An .stl, .obj or .dae file.
    scale : float
        Metres of its unit of length, such as 0.001.
    hull : bool
        Take the convex hull of what is not convex.

    Raises
    ------
    ArmError
        If the file is no readable mesh, or is not convex.
    """
    file, factors = Path(path), np.full(3, finite_array("scale", scale, ()))
    (shape,) = hulls_of_mesh(file, factors)
    if hull is not True:
        solid = coal.MeshLoader(coal.BV_AABB).load(str(file), factors).computeVolume()
        excess = shape.computeVolume() / abs(solid) - 1 if solid else np.inf
        if excess > CONVEX:
            raise ArmError(
                f"mesh {file.name!r} is not convex: its hull is {excess:.0%} larger; "
                "hull = true takes the hull"
            )
    return np.array(shape.points())


def coal_shape(body: "Body") -> coal.CollisionGeometry:
    """A body's shape in Coal."""
    if body.shape == "mesh":
        return convex_hull(np.array(body.vertices))
    if body.shape == "halfspace":
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
    kinds = {"box": coal.Box, "sphere": coal.Sphere, "capsule": coal.Capsule}
    return kinds.get(body.shape, coal.Cylinder)(*body.size)


def enclosing_corners(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners, at most ``2 * PLANES - 4``, of a polytope around points with a volume [m].

    Faces touch the points. They begin with a bevelled box; the corner that stands out farthest is
    cut off until all are within `EXCESS`.
    """
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    around = points - middle
    directions = [np.array(each) for each in itertools.product((-1.0, 0.0, 1.0), repeat=3)]
    normals = np.array([_unit(each) for each in directions if each.any()])
    offsets = _support(around, normals)
    known: dict[bytes, tuple[float, NDArray[np.float64]]] = {}
    while True:
        cell = HalfspaceIntersection(np.column_stack([normals, -offsets]), np.zeros(3))
        corners, first = np.unique(
            np.round(cell.intersections, 10) + 0.0, axis=0, return_index=True
        )
        keys = [corner.tobytes() for corner in corners]
        for key, corner, facet in zip(keys, corners, first, strict=True):
            if key not in known:
                cut = _unit(normals[cell.dual_facets[facet]].sum(axis=0))
                depth = (cut * corner).sum() - _support(around, cut[None])[0]
                known[key] = round(float(depth), 9), cut
        depths = [known[key][0] for key in keys]
        deepest = int(np.argmax(depths))
        if depths[deepest] <= EXCESS or len(normals) == PLANES:
            break
        cut = known[keys[deepest]][1]
        normals = np.vstack([normals, cut])
        offsets = np.append(offsets, _support(around, cut[None]))
    placed: NDArray[np.float64] = corners + middle
    return placed


def _unit(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit direction on the grid, roughly."""
    length = np.sqrt(np.square(direction).sum())
    unit: NDArray[np.float64] = np.round(direction / length / GRID) * GRID
    return unit


def _support(points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Reach of points along directions, rounded up to the grid [m], shape (n,)."""
    # Sums without BLAS: the same on every machine.
    x, y, z = points.T
    reach = [(nx * x + ny * y + nz * z).max() for nx, ny, nz in normals]
    return np.ceil(np.array(reach) / GRID + 1e-3) * GRID
