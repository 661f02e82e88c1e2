"""Flat arrays of polytopes and capsules around what may touch, for proofs."""

from collections.abc import Collection
from itertools import product
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kinarm._files import cached_arrays
from kinarm.arm import Arm
from kinarm.chain import Chain, point_speed
from kinarm.errors import ArmError
from kinarm.kernels.compiling import Array
from kinarm.kernels.distance import distances_from_hull
from kinarm.scene import Obstacle, Scene

BETWEEN_CAPSULES, WITH_BOX, WITH_GROUND = range(3)
"""Kinds of pairs in `ContactShapes.pairs`."""

GROUND = -1
"""Carrier, in `ContactShapes.planes`, of the ground's plane."""

EXACT = coal.Capsule | coal.Sphere
"""Shapes that equal their capsule."""

PLANE = 5
"""Entries of a separating plane (`kinarm.kernels.planes`)."""

ENCLOSURES = 1
"""To be raised when the same points get another enclosure."""

FEW, MANY = 16, 256
"""Corners of a coarse and of a fine polytope about a mesh."""

CLOSE_ENOUGH = 1e-4
"""Widening below which no more corners are taken [m]."""

SIDES = 32
"""Sides of the prism about a cylinder."""


class Enclosure(NamedTuple):
    """Hull of corners, shape (n, 3), widened by a radius [m], in a joint's frame."""

    corners: Array
    rounding: float

    def moved(self, placement: pin.SE3) -> "Enclosure":
        """The same one elsewhere."""
        corners = np.array([placement.act(each) for each in self.corners])
        return Enclosure(corners, self.rounding)


def enclosing_polytope(shape: pin.GeometryObject, most: int = MANY) -> Enclosure:
    """Rounded polytope of at most so many corners around a shape, in the frame of its joint.

    It equals a capsule, sphere or box. A mesh gets the hull of a few vertices, each the farthest
    from the hull before, widened by the distance of the farthest left. Others raise ArmError.
    """
    corners, radius = core(shape)
    local = Enclosure(corners, radius)
    if isinstance(shape.geometry, coal.Cylinder):
        local = _around(_prism(radius, float(corners[1, 2])), most)
    elif isinstance(shape.geometry, coal.ConvexBase):
        local = _around(corners, most)
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


def _prism(radius: float, half_length: float) -> Array:
    """Corners of a prism about a cylinder, shape (n, 3)."""
    angles = np.arange(SIDES) * (2 * np.pi / SIDES)
    ring = radius / np.cos(np.pi / SIDES) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    ends = (np.full((SIDES, 1), end) for end in (-half_length, half_length))
    return np.concatenate([np.concatenate([ring, end], axis=1) for end in ends])


def _around(points: Array, most: int) -> Enclosure:
    """Enclose the hull of points, shape (n, 3), through the cache."""
    made_of = np.int64(most).tobytes() + points.tobytes()
    fitted = cached_arrays("enclosure", ENCLOSURES, made_of, lambda: _fitted(points, most))
    return Enclosure(fitted["corners"], float(fitted["rounding"]))


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


def enclosing_capsule(shape: pin.GeometryObject) -> Enclosure:
    """Capsule around a shape in its joint's frame; equal to a capsule or sphere."""
    corners, radius = core(shape)
    few = len(corners) <= 2
    local = Enclosure(corners[[0, -1]], radius) if few else _capsule_around(corners)
    return local.moved(shape.placement)


def _capsule_around(points: Array) -> Enclosure:
    """Capsule along the main direction of points, shape (n, 3)."""
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
    return Enclosure(np.array([centre + low * direction, centre + high * direction]), radius)


class ContactShapes(NamedTuple):
    """Shapes, pairs and motion bounds as flat arrays.

    A *body* is a rounded polytope about a shape of the arm or, after those, an
    obstacle; last come finer polytopes about shapes whose first one is coarse.

    Attributes
    ----------
    capsules : ndarray, shape (n_shapes, 7)
        Capsule that is or encloses the shape: end points (3 + 3) in the joint
        frame, radius [m].
    boxes : ndarray, shape (n_boxes, 2, 3)
        Lower and upper corners of the obstacles, in the world turned back by
        their yaw [m].
    pairs : ndarray of int, shape (n_pairs, 3)
        Kind, index of a shape, and index of the other shape or box.
    travel : ndarray, shape (n_actuated, n_pairs)
        Bound on how far a joint moves the bodies of a pair relative to each
        other [m/rad, or m/m].
    exact : ndarray of bool, shape (n_shapes,)
        Whether the capsule equals the shape.
    bodies : ndarray of int, shape (n_bodies, 3)
        First corner, the one after the last, and joint frame: 0 is the world, k
        the k-th joint.
    corners : ndarray, shape (n_corners, 3)
        Corners in that frame [m].
    rounding : ndarray, shape (n_bodies,)
        Radius that widens the hull of the corners [m].
    extents : ndarray, shape (n_bodies, 2, 3)
        Lower and upper ends of the corners [m].
    planes : ndarray of int, shape (n_pairs, 4)
        Carrier of the separating plane, or ``GROUND``; mover against it; its
        first axis, and the one after the last.
    proxies : ndarray of int, shape (n_pairs, 2, 2)
        Bodies that stand for these two: in every step, and where it is close.
    farthest : ndarray, shape (n_actuated,)
        Largest entry of each row of ``travel``.
    turns : ndarray, shape (n_boxes, 2)
        Cosine and sine of the obstacles' yaw.
    """

    capsules: Array
    boxes: Array
    pairs: NDArray[np.int64]
    travel: Array
    exact: NDArray[np.bool_]
    bodies: NDArray[np.int64]
    corners: Array
    rounding: Array
    extents: Array
    planes: NDArray[np.int64]
    proxies: NDArray[np.int64]
    farthest: Array
    turns: Array

    @classmethod
    def build(
        cls,
        arm: Arm,
        scene: Scene,
        pairs: list[tuple[int, int]],
        n_shapes: int,
        close: Collection[int],
    ) -> "ContactShapes":
        """Flatten the shapes of an arm in a scene.

        Parameters
        ----------
        arm, scene : Arm and Scene
            What may touch.
        pairs : list of tuple
            Shapes of each pair; obstacles count from ``n_shapes``, the ground
            comes last.
        n_shapes : int
            The arm's shapes.
        close : collection of int
            Pairs that mostly are too close for coarse polytopes.
        """
        objects = list(arm.geometry.geometryObjects)
        bodies, links, finer = _enclosed(objects, scene)
        ends = np.cumsum([0, *(len(body.corners) for body in bodies)])
        rows, planes, proxies = [], [], []
        travel = np.zeros((arm.n_actuated, len(pairs)))
        for column, (first, second) in enumerate(pairs):
            between, ground = second < n_shapes, second == n_shapes + len(scene.obstacles)
            kind = BETWEEN_CAPSULES if between else WITH_GROUND if ground else WITH_BOX
            rows.append((kind, first, second if between else second - n_shapes))
            carrier, mover = (first, second) if between else (second, first)
            base = int(_keeps_height(arm.chain)) if ground else links[carrier]
            last = min(links[mover], arm.n_actuated)
            fine = (carrier if ground else finer[carrier], finer[mover])
            proxies.append((fine if column in close else (carrier, mover), fine))
            planes.append((GROUND if ground else carrier, mover, base, last))
            for axis in range(base, last):
                # The fine polytope has all corners of the coarse one.
                corners = bodies[finer[mover]].corners
                travel[axis, column] = point_speed(arm.chain, axis, links[mover], corners)
        return cls(
            capsules=np.array([np.append(*enclosing_capsule(each)) for each in objects]).reshape(
                -1, 7
            ),
            boxes=np.array([_turned_back(each) for each in scene.obstacles]).reshape(-1, 2, 3),
            pairs=np.array(rows, dtype=np.int64).reshape(-1, 3),
            travel=travel,
            exact=np.array([isinstance(each.geometry, EXACT) for each in objects], dtype=bool),
            bodies=np.stack([ends[:-1], ends[1:], np.array(links, dtype=np.int64)], axis=1),
            corners=np.concatenate([body.corners for body in bodies] or [np.zeros((0, 3))]),
            rounding=np.array([body.rounding for body in bodies], dtype=np.float64),
            extents=np.array(
                [(body.corners.min(axis=0), body.corners.max(axis=0)) for body in bodies]
            ).reshape(-1, 2, 3),
            planes=np.array(planes, dtype=np.int64).reshape(-1, 4),
            proxies=np.array(proxies, dtype=np.int64).reshape(-1, 2, 2),
            farthest=travel.max(axis=1, initial=0.0),
            turns=np.array([each.rotation[:2, 0] for each in scene.obstacles]).reshape(-1, 2),
        )


def _enclosed(
    objects: list[pin.GeometryObject], scene: Scene
) -> tuple[list[Enclosure], list[int], list[int]]:
    """Bodies of shapes and obstacles, their joints, and their finer bodies."""
    bodies = [enclosing_polytope(shape, FEW) for shape in objects]
    bodies += [Enclosure(_corners(each), 0.0) for each in scene.obstacles]
    links = [*(shape.parentJoint for shape in objects), *(0 for _ in scene.obstacles)]
    finer = list(range(len(bodies)))
    for index, shape in enumerate(objects):
        if len(bodies[index].corners) == FEW:
            finer[index] = len(bodies)
            bodies.append(enclosing_polytope(shape, MANY))
            links.append(links[index])
    return bodies, links, finer


def _corners(obstacle: Obstacle) -> Array:
    """Corners of an obstacle in the world, shape (8, 3)."""
    corners = np.array(list(product(*zip(obstacle.lower, obstacle.upper, strict=True))))
    return _turned(corners, obstacle.rotation, obstacle.centre) if obstacle.yaw else corners


def _turned_back(obstacle: Obstacle) -> Array:
    """Opposite corners of an obstacle, turned back by its yaw, shape (2, 3)."""
    ends = np.array([obstacle.lower, obstacle.upper])
    if not obstacle.yaw:
        return ends
    return ends - obstacle.centre + _turned(obstacle.centre[None], obstacle.rotation.T)


def _turned(points: Array, rotation: Array, about: Array | float = 0.0) -> Array:
    """Points, shape (n, 3), turned without BLAS: the same on every machine."""
    terms = [(points - about)[:, k, None] * rotation[:, k] for k in range(3)]
    return about + terms[0] + terms[1] + terms[2]


def _keeps_height(chain: Chain) -> bool:
    """Whether the first joint turns about the vertical, keeping heights."""
    if chain.prismatic[0]:
        return False
    w, x, y, z = chain.rotation[0]
    world_axis = pin.Quaternion(w, x, y, z).matrix() @ chain.axis[0]
    return bool(np.hypot(world_axis[0], world_axis[1]) < 1e-12)
