"""Triangle meshes of profiles and primitives, with sharp edges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import coal
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

SEGMENTS = 40
"""Straight pieces of a full circle."""

CREASE = np.cos(np.deg2rad(38.0))
"""Faces that meet at a larger angle than this keep their edge."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles.

    Attributes
    ----------
    vertices, normals : ndarray, shape (n, 3)
        Corners [m], and unit normals there; `with_normals` finds missing ones.
    faces : ndarray of int, shape (m, 3)
        Indices of corners, anticlockwise seen from outside.
    """

    vertices: Array
    faces: NDArray[np.int64]
    normals: Array | None = None

    def moved(self, translation: ArrayLike = (0, 0, 0), rotation: ArrayLike | None = None) -> Mesh:
        """Rotate by a matrix, then translate [m]."""
        vertices, normals = self.vertices, self.normals
        if rotation is not None:
            turn = np.asarray(rotation).T
            vertices, normals = vertices @ turn, None if normals is None else normals @ turn
        return Mesh(vertices + np.asarray(translation, dtype=float), self.faces, normals)

    @classmethod
    def joined(cls, meshes: Sequence[Mesh]) -> Mesh:
        """Join meshes into one; each keeps its own normals."""
        vertices, normals, faces = zip(*(mesh.with_normals() for mesh in meshes), strict=True)
        offsets = np.cumsum([0, *(len(each) for each in vertices[:-1])])
        joined = [each + offset for each, offset in zip(faces, offsets, strict=True)]
        return cls(np.concatenate(vertices), np.concatenate(joined), np.concatenate(normals))

    def welded(self) -> Mesh:
        """Join corners less than 1e-6 m apart, and drop faces without area."""
        places, welded = np.unique(np.round(self.vertices, 6), axis=0, return_inverse=True)
        faces = welded.reshape(-1)[self.faces]
        return Mesh(places, faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)])

    def with_normals(self) -> tuple[Array, Array, NDArray[np.int64]]:
        """Vertices, normals and faces, with corners split at edges."""
        if self.normals is not None:
            return self.vertices, self.normals, self.faces
        places, welded = np.unique(np.round(self.vertices, 6), axis=0, return_inverse=True)
        corners = welded.reshape(-1)[self.faces]
        a, b, c = (places[corners[:, k]] for k in range(3))
        weighted = np.cross(b - a, c - a)
        flat = weighted / np.maximum(np.linalg.norm(weighted, axis=1, keepdims=True), 1e-30)
        normals = _corner_normals(corners.reshape(-1), weighted, flat)
        keys = np.column_stack([places[corners.reshape(-1)], np.round(normals, 4)])
        unique, inverse = np.unique(keys, axis=0, return_inverse=True)
        return unique[:, :3], unique[:, 3:], inverse.reshape(-1, 3)


def _corner_normals(corners: NDArray[np.int64], weighted: Array, flat: Array) -> Array:
    """Mean normal, at each face's corners, of the faces that meet without an edge."""
    empty = np.repeat(np.linalg.norm(weighted, axis=1) == 0, 3)
    solid = np.flatnonzero(~empty)  # else a trace at rest has thousands
    order = solid[np.argsort(corners[solid], kind="stable")]
    counts = np.bincount(corners[solid], minlength=corners.max(initial=-1) + 1)
    starts = np.cumsum(counts) - counts
    n_joined = counts[corners]
    mine = np.repeat(np.arange(len(corners)), n_joined)
    within = np.arange(len(mine)) - np.repeat(np.cumsum(n_joined) - n_joined, n_joined)
    theirs = order[starts[corners[mine]] + within]
    joins = (flat[mine // 3] * flat[theirs // 3]).sum(axis=1) >= CREASE
    joins |= empty[mine]  # a face without area takes any side
    total = np.zeros((len(corners), 3))
    np.add.at(total, mine[joins], weighted[theirs[joins] // 3])
    unit: Array = total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-30)
    return unit


def loft(rings: Array) -> Mesh:
    """Skin a stack of closed rings, shape (n_rings, n_points, 3), and close both ends.

    Faces come stretch by stretch; points go anticlockwise seen against the stack's direction [m].
    """
    levels, around = rings.shape[:2]
    here = np.arange(around)
    after = (here + 1) % around
    below, above = np.full(around, levels * around), np.full(around, levels * around + 1)
    first = np.stack([here, after, after + around], 1)
    stretch = np.concatenate([first, np.stack([here, after + around, here + around], 1)])
    last = (levels - 1) * around
    walls = (stretch + around * np.arange(levels - 1)[:, None, None]).reshape(-1, 3)
    ends = [np.stack([below, after, here], 1), np.stack([above, last + here, last + after], 1)]
    middles = [rings[0].mean(axis=0), rings[-1].mean(axis=0)]
    return Mesh(np.concatenate([rings.reshape(-1, 3), middles]), np.concatenate([walls, *ends]))


def lathe(profile: Sequence[tuple[float, float]]) -> Mesh:
    """Turn a profile of positions and radii [m] about z."""
    angle = np.linspace(0, 2 * np.pi, SEGMENTS, endpoint=False)
    position, radius = np.array(profile, dtype=float).T
    across = radius[:, None] * np.cos(angle), radius[:, None] * np.sin(angle)
    along = np.repeat(position[:, None], SEGMENTS, axis=1)
    return loft(np.stack((*across, along), axis=2))


def cylinder(length: float, radius: float) -> Mesh:
    """A cylinder along z, about the origin [m]."""
    half = length / 2
    return lathe([(-half, radius), (half, radius)])


def box(size: ArrayLike, chamfer: float = 0.0) -> Mesh:
    """A box about the origin with chamfered edges [m]."""
    half = np.asarray(size, dtype=float) / 2
    halves = half - chamfer * (1 - np.eye(3)) if chamfer else half[None]
    corners = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
    return _convex_hull((corners * halves[:, None]).reshape(-1, 3))


def _convex_hull(points: Array) -> Mesh:
    """Convex hull of points, shape (n, 3)."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    faces = hull.simplices.astype(np.int64)
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return Mesh(points, faces)


def capsule(length: float, radius: float) -> Mesh:
    """A cylinder along z with half spheres at its ends; a sphere at length 0 [m]."""
    turn = np.linspace(0, np.pi / 2, 9)
    low = [(-length / 2 - radius * np.cos(t), radius * np.sin(t)) for t in turn]
    return lathe([*low, *[(-position, r) for position, r in reversed(low)]])


def tube(points: ArrayLike, radius: float, sides: int = 6) -> Mesh:
    """A tube along points, with 2 * ``sides`` faces per stretch.

    Parameters
    ----------
    points, radius : array_like, shape (n, 3), and float
        At least two points, and the tube's radius [m].
    sides : int
        Corners of the cross section.
    """
    middle = np.asarray(points, dtype=float)
    forward = np.gradient(middle, axis=0)
    across = np.cross(forward, [0.31, 0.83, 0.47])
    beside = np.cross(forward, across)
    across, beside = (
        each / np.linalg.norm(each, axis=1, keepdims=True).clip(1e-12) for each in (across, beside)
    )
    angle = np.linspace(0, 2 * np.pi, sides, endpoint=False)[:, None, None]
    around = np.cos(angle) * across + np.sin(angle) * beside
    return loft((middle + radius * around).transpose(1, 0, 2))


def from_coal(shape: coal.CollisionGeometry) -> Mesh:
    """Skin of a primitive or convex hull in its own frame."""
    if isinstance(shape, coal.Box):
        return box(2 * np.array(shape.halfSide))
    if isinstance(shape, coal.Sphere):
        return capsule(0.0, shape.radius)
    if isinstance(shape, coal.Capsule):
        return capsule(2 * shape.halfLength, shape.radius)
    if isinstance(shape, coal.Cylinder):
        return cylinder(2 * shape.halfLength, shape.radius)
    return _convex_hull(np.array(shape.points()))
