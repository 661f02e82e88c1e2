"""Convex hulls of meshes, with few vertices: never smaller than the hull of the mesh."""

import itertools
from pathlib import Path

import coal
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import HalfspaceIntersection

from kinarm._archive import Arrays, cached_arrays
from kinarm._files import first_line
from kinarm.errors import ArmError
from kinarm.mesh_content import check_vertices, mesh_content

VERSION = 1
"""To be raised when the same mesh gets another hull."""

MANY_VERTICES = 1000
"""Vertices above which a hull is replaced by a simpler one around it."""

PLANES = 160
"""Faces of such a hull at most: it has twice as many vertices less four."""

EXCESS = 1e-4
"""A corner of it that stands out by less is left as it is [m]."""

GRID = 1e-9
"""Normals and offsets are multiples of this [1 and m], so that machines agree on them."""


def hull_of_mesh(path: Path, scale: NDArray[np.float64]) -> coal.ConvexBase:
    """Convex hull of a mesh, or a simpler polytope around it where it has many vertices.

    Its corners are kept in the cache folder.

    Parameters
    ----------
    path : Path
        File of the mesh; its vertices count, not its triangles.
    scale : ndarray, shape (3,)
        Factors along its axes.

    Raises
    ------
    ArmError
        If the file cannot be read as a mesh.
    """
    content = scale.tobytes() + mesh_content(path)
    corners = cached_arrays("hull", VERSION, content, lambda: _corners(path, scale))["corners"]
    check_vertices(path, corners.reshape(-1, 3))
    return _hull(corners)


def _corners(path: Path, scale: NDArray[np.float64]) -> Arrays:
    """Corners of the hull of a mesh, or of the polytope around it."""
    try:
        mesh = coal.MeshLoader(coal.BV_AABB).load(str(path), scale)
        check_vertices(path, mesh.vertices())
        mesh.buildConvexHull(True, "Qt")
        corners = np.array(mesh.convex.points())
        return {"corners": enclosing_corners(corners) if len(corners) > MANY_VERTICES else corners}
    except (ValueError, RuntimeError) as error:
        raise ArmError(f"mesh {path.name} cannot be loaded: {first_line(error)}") from error


def _hull(points: NDArray[np.float64]) -> coal.ConvexBase:
    """Convex hull of points, shape (n, 3)."""
    corners = coal.StdVec_Vec3s()
    corners.extend(points)
    return coal.Convex.convexHull(corners, True, "Qt")


def enclosing_corners(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners of a polytope of few faces around a set of points.

    Faces touch the set. They start with a box and its bevelled corners; then the corner that
    stands out farthest is cut off, until none does by more than `EXCESS`.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Points that span a volume [m].

    Returns
    -------
    ndarray, shape (n_corners, 3)
        At most ``2 * PLANES - 4`` [m].
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
    """A direction of about length one, on the grid."""
    length = np.sqrt(np.square(direction).sum())
    unit: NDArray[np.float64] = np.round(direction / length / GRID) * GRID
    return unit


def _support(points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far points reach along directions at most, rounded up to the grid [m], shape (n,)."""
    # Sums without BLAS: the same on every machine.
    x, y, z = points.T
    reach = [(nx * x + ny * y + nz * z).max() for nx, ny, nz in normals]
    support: NDArray[np.float64] = np.ceil(np.array(reach) / GRID + 1e-3) * GRID
    return support
