"""Bodies: what can touch, a shape with a pose, given or drawn for every episode.

What cannot be is a `ProblemError`.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from kinarm._fields import OPTIONAL, Checked
from kinarm._files import absolute
from kinarm.body_motion import BodyMotion
from kinarm.errors import FROM_ZERO, NOT_NEGATIVE, InvalidInputError, KinarmError, ProblemError

Point = tuple[float, float, float]

SMALLEST, LARGEST = 1e-6, 1e4
"""Range of sizes and vertices of bodies [m]."""

MOST_VERTICES = 1000
"""Vertices of a mesh at most."""

FLAT = 1e-6
"""Thickness over width of a mesh that has no volume."""

PARKED = (0.0, 0.0, -1e6)
"""Where bodies are that an episode does without [m]."""

MOST = 100
"""Bodies of an entry at most."""

SHAPES = {
    "box": ("x", "y", "z"),
    "sphere": ("radius",),
    "capsule": ("radius", "length"),
    "cylinder": ("radius", "length"),
    "halfspace": (),
    "mesh": (),
}
"""Shapes, and the numbers of their sizes [m]."""


def rotation_matrix(rpy: Point) -> NDArray[np.float64]:
    """Rotation by roll, pitch and yaw about the fixed axes x, y and z, shape (3, 3).

    Entries have 12 digits: the same on every machine.
    """
    (cr, cp, cy), (sr, sp, sy) = (
        [round(of(angle), 12) + 0.0 for angle in rpy] for of in (math.cos, math.sin)
    )
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rotation_of_quaternion(quaternion: tuple[float, float, float, float]) -> NDArray[np.float64]:
    """Rotation of a quaternion w, x, y, z of any length but zero, shape (3, 3)."""
    w, x, y, z = quaternion
    s = 2.0 / (w * w + x * x + y * y + z * z)
    return np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
            [s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)],
            [s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)],
        ]
    )


@dataclass(frozen=True, kw_only=True)
class Body(Checked):
    """A solid shape with a pose.

    Parameters
    ----------
    name : str
        How contact reports call it.
    shape : str
        ``"box"``, ``"sphere"``, ``"capsule"``, ``"cylinder"``, ``"halfspace"``
        or ``"mesh"``. Capsules and cylinders have their axis along z, and a
        half-space is all below z = 0, before they are turned.
    size : tuple of float
        Edges x, y and z of a box; radius of a sphere; radius and length of a
        cylinder or a capsule, whose ends are beyond that; else nothing [m].
    vertices : tuple
        Points of a mesh, of which the convex hull counts [m].
    position : tuple of float
        Its centre, a point of the half-space's plane, or the origin of the
        vertices [m].
    rpy : tuple of float
        Roll, pitch and yaw about fixed axes [rad].
    quaternion : tuple of float
        Its orientation as w, x, y and z, instead of rpy.
    motion : BodyMotion, optional
        How it moves, if it does.
    """

    name: str
    shape: Literal["box", "sphere", "capsule", "cylinder", "halfspace", "mesh"]
    size: tuple[float, ...] = field(default=(), metadata=OPTIONAL)
    vertices: tuple[Point, ...] = field(default=(), metadata=OPTIONAL)
    position: Point = (0.0, 0.0, 0.0)
    rpy: Point = field(default=(0.0, 0.0, 0.0), metadata=OPTIONAL)
    quaternion: tuple[float, float, float, float] | None = None
    motion: BodyMotion | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        labels = SHAPES[self.shape]
        if len(self.size) != len(labels):
            wanted = f"{', '.join(labels)} [m]" if labels else "empty"
            raise ProblemError(f"{self._told}: size must be {wanted}, got {list(self.size)}")
        for label, length in zip(labels, self.size, strict=True):
            if not SMALLEST <= length <= LARGEST:
                raise ProblemError(
                    f"{self._told}: {label} must be {SMALLEST:g} to {LARGEST:g} m, got {length:g}"
                )
        if self.quaternion is not None:
            if self.rpy != (0.0, 0.0, 0.0):
                raise ProblemError(f"{self._told} has both rpy and quaternion")
            if not 1e-3 < sum(each * each for each in self.quaternion) < 1e3:
                raise ProblemError(f"{self._told}: quaternion must have a length of about 1")
        if self.shape == "mesh":
            self._check_vertices()
        elif self.vertices:
            raise ProblemError(f"{self._told}: vertices are for shape 'mesh'")

    def _check_vertices(self) -> None:
        points = np.array(self.vertices).reshape(-1, 3)
        if not 4 <= len(points) <= MOST_VERTICES:
            raise ProblemError(
                f"{self._told}: 4 to {MOST_VERTICES} vertices are possible, got {len(points)}"
            )
        extents = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        if extents[2] <= FLAT * extents[0] or np.abs(points).max() > LARGEST:
            raise ProblemError(f"{self._told}: the hull of the vertices has no volume, or no end")

    @property
    def _told(self) -> str:
        return f"{self.shape} {self.name!r}"

    @property
    def rotation(self) -> NDArray[np.float64]:
        """Orientation in the world as a rotation matrix, shape (3, 3)."""
        if self.quaternion is not None:
            return rotation_of_quaternion(self.quaternion)
        return rotation_matrix(self.rpy)

    def contains(self, points: NDArray[np.float64], margin: float) -> NDArray[np.bool_]:
        """Whether points, shape (n, 3), lie in it, if it were larger by a margin [m]."""
        x, y, z = ((points - np.array(self.position)) @ self.rotation).T
        if self.shape == "mesh":
            from scipy.spatial import ConvexHull

            planes = ConvexHull(np.array(self.vertices)).equations
            heights = planes[:, :3] @ np.array([x, y, z]) + planes[:, 3:]
            return np.asarray((heights <= margin).all(axis=0))
        if self.shape == "halfspace":
            return np.asarray(z <= margin)
        if self.shape == "box":
            half = np.array(self.size)[:, None] / 2
            return np.asarray((np.abs([x, y, z]) <= half + margin).all(axis=0))
        radius, length = (*self.size, 0.0)[:2]
        beyond = np.abs(z) - length / 2
        if self.shape == "cylinder":
            return np.asarray((np.hypot(x, y) <= radius + margin) & (beyond <= margin))
        return np.asarray(np.hypot(np.hypot(x, y), np.fmax(beyond, 0.0)) <= radius + margin)


@dataclass(frozen=True, kw_only=True)
class RandomBodies(Checked):
    """Bodies of one shape, whose number, sizes and poses differ between episodes.

    All are uniform within their ranges.

    Parameters
    ----------
    name : str
        How contact reports call them, with a number.
    shape : str
        A shape of `kinarm.Body`, but no half-space.
    count : tuple of int
        The fewest and the most of them.
    smallest, largest : tuple of float
        Range of their sizes, as of `kinarm.Body` [m].
    vertices : tuple
        Points of a mesh, which has one size [m].
    near : str
        What their positions are relative to: ``"world"``; ``"path"``, a random
        point between the tool at the start and the goal; or the name of an
        obstacle, an upright box, on whose top they stand.
    lower, upper : tuple of float
        Range of their positions, relative to that [m]. On an obstacle, the
        whole top by default.
    turned : str
        ``"no"``, ``"yaw"``, about the vertical, or ``"any"``.
    clear_of_goal : float
        Distance that they keep from the goal when an episode begins [m].
    motion : BodyMotion, optional
        How all of them move, if they do.
    """

    name: str
    shape: Literal["box", "sphere", "capsule", "cylinder", "mesh"]
    count: tuple[int, int] = field(default=(1, 1), metadata={**FROM_ZERO, "at_most": MOST})
    smallest: tuple[float, ...] = ()
    largest: tuple[float, ...] = ()
    vertices: tuple[Point, ...] = field(default=(), metadata=OPTIONAL)
    near: str = "world"
    lower: Point | None = None
    upper: Point | None = None
    turned: Literal["no", "yaw", "any"] = "no"
    clear_of_goal: float = field(default=0.05, metadata=NOT_NEGATIVE)
    motion: BodyMotion | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        told = f"random bodies {self.name!r}"
        if self.count[0] > self.count[1]:
            raise ProblemError(f"{told}: count goes from {self.count[0]} to {self.count[1]}")
        for size in (self.smallest, self.largest):
            self.sized(size)
        if any(low > high for low, high in zip(self.smallest, self.largest, strict=True)):
            raise ProblemError(f"{told}: a size of smallest exceeds that of largest")
        if (self.lower is None) != (self.upper is None):
            raise ProblemError(f"{told} have one of lower and upper only")
        if self.lower is None or self.upper is None:
            if self.near == "world":
                raise ProblemError(f"{told} need lower and upper, the range of their positions")
        elif any(low > high for low, high in zip(self.lower, self.upper, strict=True)):
            raise ProblemError(f"{told}: lower {self.lower} exceeds upper {self.upper}")
        if self.turned == "any" and self.near not in ("world", "path"):
            raise ProblemError(f"{told} stand on an obstacle: turned must be no or yaw")

    @property
    def slots(self) -> tuple[Body, ...]:
        """As many bodies as there may be, far away."""
        numbers = range(1, self.count[1] + 1)
        return tuple(self.sized(self.largest, f"{self.name} {k}") for k in numbers)

    def sized(self, size: tuple[float, ...], name: str = "") -> Body:
        """One of them far away, of a size and name."""
        return Body(
            name=name or self.name,
            shape=self.shape,
            size=size,
            vertices=self.vertices,
            position=PARKED,
            motion=self.motion,
        )


@dataclass(frozen=True, kw_only=True)
class HeldBody(Body):
    """A body that a link of the arm holds: its pose is in the link's frame.

    Parameters
    ----------
    link : str
        Link that holds it.
    """

    link: str

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.shape == "halfspace":
            raise ProblemError(f"{self._told} has no end: link {self.link!r} cannot hold it")
        if self.motion is not None:
            raise ProblemError(f"{self._told} moves with link {self.link!r}, not by itself")


def read_meshes(table: Any, path: Path) -> None:
    """Put vertices in the place of mesh files, in the lists of bodies of a file's table.

    Meshes are named from the folder of the file, at ``path``.
    """
    lists = table.items() if isinstance(table, Mapping) else ()
    listed = (
        (name, *each)
        for name, bodies in lists
        if isinstance(bodies, list)
        for each in enumerate(bodies)
    )
    for name, number, entry in listed:
        if isinstance(entry, dict) and isinstance(entry.get("mesh"), str):
            from kinarm.meshes import mesh_vertices

            if "vertices" in entry:
                raise InvalidInputError(f"{path}: {name}[{number}] has both mesh and vertices")
            given = {key: entry.pop(key) for key in ("mesh", "scale", "hull") if key in entry}
            try:
                file = absolute(path).parent / given.pop("mesh")
                entry["vertices"] = mesh_vertices(file, **given).tolist()
            except KinarmError as error:
                raise InvalidInputError(f"{path}: {name}[{number}]: {error}") from error
            entry.setdefault("shape", "mesh")
