"""Polytopes and capsules around shapes, none of which is too small, and capsules in them."""

from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from kinarm._files import cached_arrays
from kinarm.errors import ArmError
from kinarm.kernels.compiling import Array
from kinarm.kernels.distance import distances_from_hull

ENCLOSURES = 1
"""To be raised when the same points get another enclosure."""

SOME, MANY = 40, 256
"""Corners of a coarse and a fine polytope about a mesh."""

CLOSE_ENOUGH = 1e-4
"""Widening below which no more corners are taken [m]."""

INNER = 1
"""To be raised when the same points get another capsule inside."""

OUTER, CIRCLE_STEPS = 1, 2000
"""To be raised when the same points get another capsule around; steps of its search."""

SIDES = 32
"""Sides of the prism about a cylinder."""


class Enclosure(NamedTuple):
    """Hull of corners, shape (n, 3), widened by a radius [m], in a joint's frame.

    Widened by the excess less, it lies in the shape.
    """

    corners: Array
    rounding: float
    excess: float = 0.0

    def moved(self, placement: pin.SE3) -> "Enclosure":
        """The same one elsewhere."""
        corners = np.array([placement.act(each) for each in self.corners])
        return self._replace(corners=corners)


def enclosing_polytope(shape: pin.GeometryObject, most: int = MANY) -> Enclosure:
    """Rounded polytope of at most so many corners around a shape, in the frame of its joint.

    It equals a capsule, sphere or box. A mesh gets the hull of a few vertices, each the farthest
    from the hull before, widened by the distance of the farthest left. Others raise ArmError.
    """
    corners, radius = core(shape)
    local = Enclosure(corners, radius)
    if isinstance(shape.geometry, coal.Cylinder):
        local = around(prism(radius, float(corners[1, 2])), most)._replace(excess=np.inf)
    elif isinstance(shape.geometry, coal.ConvexBase):
        local = around(corners, most)
    return local.moved(shape.placement)


def core(shape: pin.GeometryObject) -> tuple[Array, float]:
    """Corners, shape (n, 3), and radius whose widened hull is or encloses a shape."""
    body = shape.geometry
    if isinstance(body, coal.Sphere):
        return np.zeros((1, 3)), float(body.radius)
    if isinstance(body, coal.Capsule | coal.Cylinder):
        half = np.array([0.0, 0.0, float(body.halfLength)])
        return np.array([-half, half]), float(body.radius)
    if isinstance(body, coal.Box):
        return np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T * body.halfSide, 0.0
    if isinstance(body, coal.ConvexBase):
        return np.array(body.points()), 0.0
    raise ArmError(f"collision shape {shape.name!r} is a {type(body).__name__}: not supported")


def prism(radius: float, half_length: float) -> Array:
    """Corners of a prism about a cylinder, shape (n, 3)."""
    angles = np.arange(SIDES) * (2 * np.pi / SIDES)
    ring = radius / np.cos(np.pi / SIDES) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    ends = (np.full((SIDES, 1), end) for end in (-half_length, half_length))
    return np.concatenate([np.concatenate([ring, end], axis=1) for end in ends])


def around(points: Array, most: int) -> Enclosure:
    """Enclose the hull of points, shape (n, 3), of which the corners are, through the cache."""
    made_of = np.int64(most).tobytes() + points.tobytes()
    fitted = cached_arrays("enclosure", ENCLOSURES, made_of, lambda: _fitted(points, most))
    rounding = float(fitted["rounding"])
    return Enclosure(fitted["corners"], rounding, excess=rounding)


def _fitted(points: Array, most: int) -> dict[str, Any]:
    """Corners and rounding that enclose the hull of points."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    chosen = [int(np.square(points - middle).sum(axis=1).argmax())]
    distances = np.empty(len(points))
    while True:
        distances_from_hull(points[chosen], points, distances)
        farthest = int(distances.argmax())
        if distances[farthest] <= CLOSE_ENOUGH or len(chosen) == most:
            rounding = float(distances[farthest]) * (1 + 1e-9) + 1e-9
            return {"corners": points[chosen], "rounding": rounding}
        chosen.append(farthest)


def outer_capsule(shape: pin.GeometryObject) -> Enclosure:
    """Slim capsule around a shape, in its joint's frame; equal to a capsule or sphere."""
    (corners, radius, _), excess = enclosing_polytope(shape), 0.0
    if len(corners) > 2:
        fitted = cached_arrays("outer", OUTER, corners.tobytes(), lambda: _capsule_about(corners))
        corners, radius, excess = fitted["corners"], radius + float(fitted["radius"]), np.inf
    return Enclosure(corners[[0, -1]], radius, excess)


def inner_capsule(shape: pin.GeometryObject) -> Enclosure:
    """Capsule in a shape, in its joint's frame; equal to a capsule or sphere."""
    corners, radius = core(shape)
    if isinstance(shape.geometry, coal.Cylinder):
        corners = prism(radius * np.cos(np.pi / SIDES), float(corners[1, 2]))
    if len(corners) > 2:
        fitted = cached_arrays("inner", INNER, corners.tobytes(), lambda: _capsule_in(corners))
        corners, radius = fitted["corners"], float(fitted["radius"])
    return Enclosure(corners[[0, -1]], radius).moved(shape.placement)


def _capsule_in(points: Array) -> dict[str, Any]:
    """Largest capsule found in the hull of points, about the centre of its largest ball."""
    from scipy.optimize import linprog
    from scipy.spatial import ConvexHull

    size = float(np.ptp(points, axis=0).max())
    planes = ConvexHull(points / size).equations
    normals, offsets = planes[:, :3], -planes[:, 3]
    rows = np.column_stack([normals, np.ones(len(normals))])
    solved: Any = linprog([0, 0, 0, -1], rows, offsets, bounds=[(None, None)] * 4)
    centre, largest = solved.x[:3], solved.x[3]
    best, found = 0.0, {"corners": points[:1], "radius": 0.0}
    for along in np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]:
        for radius in largest * np.linspace(0.4, 0.999, 13):
            room = offsets - normals @ centre - radius
            if room.min() <= 0:
                continue
            ends = room / (normals @ along + 1e-300)
            low, high = ends[ends < 0].max(), ends[ends > 0].min()
            volume = radius**2 * (high - low + 4 / 3 * radius)
            if volume > best:
                best, corners = volume, centre + np.outer([low, high], along)
                found = {"corners": size * corners, "radius": size * radius}
    return found


def _capsule_about(points: Array) -> dict[str, Any]:
    """Capsule about points along one of their principal axes: the smallest of three."""
    least, found = np.inf, {"corners": points[:1], "radius": np.inf}
    for along in np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]:
        places = points @ along
        across = points - np.outer(places, along)
        # Steps to the farthest point end in the smallest circle's centre (Badoiu and Clarkson).
        centre = across.mean(axis=0)
        for k in range(2, CIRCLE_STEPS):
            off = across - centre
            centre = centre + off[np.square(off).sum(axis=1).argmax()] / k
        squares = np.square(across - centre).sum(axis=1)
        room = np.sqrt(squares.max() - squares)
        low, high = (places + room).min(), (places - room).max()
        low, high = min(low, (low + high) / 2), max(high, (low + high) / 2)
        beyond = np.clip(places, low, high) - places
        radius = np.sqrt((squares + beyond**2).max()) * (1 + 1e-9) + 1e-9
        volume = radius**2 * (high - low + 4 / 3 * radius)
        if volume < least:
            least, corners = volume, centre + np.outer([low, high], along)
            found = {"corners": corners, "radius": radius}
    return found
