"""The shapes that may touch as flat arrays, for the compiled kernels."""

from collections.abc import Collection
from itertools import product
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kinarm.arm import Arm
from kinarm.chain import Chain
from kinarm.enclosures import FEW, MANY, Enclosure, enclosing_capsule, enclosing_polytope
from kinarm.motion_bounds import point_speed
from kinarm.scene import Obstacle, Scene

BETWEEN_CAPSULES, WITH_BOX, WITH_GROUND = range(3)
"""Kinds of pairs in `ContactShapes.pairs`."""

GROUND = -1
"""Carrier, in `ContactShapes.planes`, of the plane that is the ground."""

EXACT = coal.Capsule | coal.Sphere
"""Shapes that equal the capsule that encloses them."""

PLANE = 5
"""Entries of a separating plane; see `kinarm.kernels.planes`."""


class ContactShapes(NamedTuple):
    """Shapes, pairs and motion bounds as flat arrays.

    A *body* is a shape of the arm or, after those, an obstacle, enclosed by a rounded polytope;
    after those come finer polytopes about shapes whose first one is coarse.

    Attributes
    ----------
    capsules : ndarray, shape (n_shapes, 7)
        The capsule that is or encloses the shape: its end points (3 + 3) in the joint frame and
        its radius [m].
    boxes : ndarray, shape (n_boxes, 2, 3)
        Lower and upper corners of the obstacles, in the world turned back by their yaw [m].
    pairs : ndarray of int, shape (n_pairs, 3)
        Kind of the pair, index of a shape, and index of the other shape or box.
    travel : ndarray, shape (n_actuated, n_pairs)
        Bound on how far a joint moves the two bodies of a pair relative to each other
        [m/rad, or m/m].
    exact : ndarray of bool, shape (n_shapes,)
        Whether the capsule is the shape, rather than encloses it.
    bodies : ndarray of int, shape (n_bodies, 3)
        First corner of a body, the one after its last, and the joint frame that carries it: 0 is
        the world, k the k-th joint.
    corners : ndarray, shape (n_corners, 3)
        Corners in that frame [m].
    rounding : ndarray, shape (n_bodies,)
        Radius by which the hull of the corners is widened [m].
    extents : ndarray, shape (n_bodies, 2, 3)
        Lower and upper ends of the corners [m].
    planes : ndarray of int, shape (n_pairs, 4)
        Per pair: the body that carries the separating plane, or ``GROUND``; the body that moves
        against it; the first axis that moves it, and the one after the last.
    proxies : ndarray of int, shape (n_pairs, 2, 2)
        Per pair, the bodies that stand for these two: in every step, and where it is close.
    farthest : ndarray, shape (n_actuated,)
        Largest entry of each row of ``travel``.
    turns : ndarray, shape (n_boxes, 2)
        Cosine and sine of the yaw of the obstacles.
    """

    capsules: NDArray[np.float64]
    boxes: NDArray[np.float64]
    pairs: NDArray[np.int64]
    travel: NDArray[np.float64]
    exact: NDArray[np.bool_]
    bodies: NDArray[np.int64]
    corners: NDArray[np.float64]
    rounding: NDArray[np.float64]
    extents: NDArray[np.float64]
    planes: NDArray[np.int64]
    proxies: NDArray[np.int64]
    farthest: NDArray[np.float64]
    turns: NDArray[np.float64]

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
            Shapes of each pair; obstacles count from ``n_shapes``, and the ground comes last.
        n_shapes : int
            Number of the arm's shapes.
        close : collection of int
            Pairs that are mostly so close to each other that coarse polytopes tell nothing.
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
                # Corners of the coarse polytope are among those of the fine one.
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
    """Bodies around shapes and obstacles, the joints that carry them, and each one's finer body."""
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


def _corners(obstacle: Obstacle) -> NDArray[np.float64]:
    """Corners of an obstacle in the world, shape (8, 3)."""
    corners = np.array(list(product(*zip(obstacle.lower, obstacle.upper, strict=True))))
    return _turned(corners, obstacle.rotation, obstacle.centre) if obstacle.yaw else corners


def _turned_back(obstacle: Obstacle) -> NDArray[np.float64]:
    """Opposite corners of an obstacle in the world turned back by its yaw, shape (2, 3)."""
    ends = np.array([obstacle.lower, obstacle.upper])
    if not obstacle.yaw:
        return ends
    return ends - obstacle.centre + _turned(obstacle.centre[None], obstacle.rotation.T)


def _turned(
    points: NDArray[np.float64],
    rotation: NDArray[np.float64],
    about: NDArray[np.float64] | float = 0.0,
) -> NDArray[np.float64]:
    """Points, shape (n, 3), turned about another one; without BLAS, the same on every machine."""
    terms = [(points - about)[:, k, None] * rotation[:, k] for k in range(3)]
    return about + terms[0] + terms[1] + terms[2]


def _keeps_height(chain: Chain) -> bool:
    """Whether the first joint is a vertical revolute one, which leaves heights unchanged."""
    if chain.prismatic[0]:
        return False
    w, x, y, z = chain.rotation[0]
    world_axis = pin.Quaternion(w, x, y, z).matrix() @ chain.axis[0]
    return bool(np.hypot(world_axis[0], world_axis[1]) < 1e-12)
