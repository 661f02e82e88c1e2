"""Capsules around collision shapes, from which the kernels prove freedom from contact."""

from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kinarm.errors import ArmError


class Capsule(NamedTuple):
    """A segment with a radius, in the frame of the joint that carries it."""

    start: NDArray[np.float64]
    end: NDArray[np.float64]
    radius: float


def enclosing_capsule(shape: pin.GeometryObject) -> Capsule:
    """Capsule around a shape, in the frame of its joint; it equals a capsule or sphere.

    Raises
    ------
    ArmError
        If the shape is no capsule, sphere, cylinder, box or convex hull.
    """
    body = shape.geometry
    if isinstance(body, coal.Sphere):
        local = Capsule(np.zeros(3), np.zeros(3), float(body.radius))
    elif isinstance(body, coal.Capsule | coal.Cylinder):
        half = np.array([0.0, 0.0, float(body.halfLength)])
        local = Capsule(-half, half, float(body.radius))
    elif isinstance(body, coal.Box):
        signs = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T
        local = _capsule_around(signs * body.halfSide)
    elif isinstance(body, coal.ConvexBase):
        local = _capsule_around(np.array(body.points()))
    else:
        raise ArmError(f"collision shape {shape.name!r} is a {type(body).__name__}: not supported")
    placement = shape.placement
    return Capsule(placement.act(local.start), placement.act(local.end), local.radius)


def _capsule_around(points: NDArray[np.float64]) -> Capsule:
    """Capsule along the longest principal direction of a set of points, shape (n, 3)."""
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    _, _, directions = np.linalg.svd(points - centre, full_matrices=False)
    direction = directions[0]
    along = (points - centre) @ direction
    across = np.linalg.norm(points - centre - along[:, None] * direction, axis=1)
    radius = float(across.max()) * (1 + 1e-9)
    cap = np.sqrt(np.maximum(radius**2 - across**2, 0.0))
    low, high = float((along + cap).min()), float((along - cap).max())
    if low > high:
        low = high = (low + high) / 2
    return Capsule(centre + low * direction, centre + high * direction, radius)


def is_capsule(shape: pin.GeometryObject) -> bool:
    """Whether a shape equals the capsule that encloses it."""
    return isinstance(shape.geometry, coal.Capsule | coal.Sphere)
