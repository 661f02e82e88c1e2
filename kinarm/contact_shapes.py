"""Flat arrays of polytopes and capsules around what may touch, for proofs."""

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kinarm.arm import Arm
from kinarm.bodies import Body
from kinarm.chain import Chain, point_speed
from kinarm.enclosures import (
    MANY,
    SOME,
    Enclosure,
    around,
    enclosing_polytope,
    inner_capsule,
    outer_capsule,
    prism,
)
from kinarm.kernels.compiling import Array
from kinarm.kernels.lanes import LANES
from kinarm.scene import Scene

BETWEEN_CAPSULES, WITH_BOX, WITH_HALFSPACE = range(3)
"""Kinds of pairs in `ContactShapes.pairs`."""

PLANE = 5
"""Entries of a separating plane (`kinarm.kernels.planes`)."""


class ContactShapes(NamedTuple):
    """Shapes, pairs and motion bounds as flat arrays.

    A *body* is a rounded polytope: about each shape of the arm, then of the
    scene; last come fine ones about shapes whose first is coarse. Each lies in a
    frame, of which there is a row in ``poses``: frame 0 is the world, k the k-th
    joint, and further ones are those of the scene's bodies. Such a row (`placed`)
    has a size and a rounding instead of a quaternion: the body's corners are
    multiplied by that size.

    Attributes
    ----------
    capsules : ndarray, shape (n_shapes, 7)
        Capsule that is or lies in a shape: end points (3 + 3) in its frame,
        radius [m]. For the scene's bodies before the size, and with a radius of
        minus infinity unless they are exact.
    around : ndarray, shape (n_own, 7)
        Capsule around each of the arm's shapes: middle and half of its axis
        (3 + 3) in its frame, radius [m].
    pairs : ndarray of int, shape (n_pairs + n_seen, 3)
        Kind, index of a moving shape of the arm, and index of the other shape:
        of the pairs that are tested, then of others that are only seen.
    travel : ndarray, shape (n_joints, n_pairs)
        Bound on how far a joint moves the shapes of a pair relative to each
        other [m/rad, or m/m]; of those that equal their body, its corners.
    exact : ndarray of bool, shape (n_shapes,)
        Whether a shape equals its capsule, box or half-space.
    bodies : ndarray of int, shape (n_bodies, 5)
        First corner, the one after the last, and frame; and first block, and the
        one after the last.
    corners : ndarray, shape (n_corners, 3)
        Corners in that frame [m].
    blocks : ndarray, shape (n_blocks, 4, LANES)
        The corners of each body once more, x, y, z and row; the last one repeats.
    rounding : ndarray, shape (n_bodies,)
        Radius that widens the hull of the corners [m]; for the scene's bodies,
        it is in their rows.
    excess : ndarray, shape (n_bodies,)
        How much less the corners may be widened to lie in the shape [m];
        infinite if they lie outside.
    extents : ndarray, shape (n_bodies, 2, 3)
        Lower and upper ends of the corners [m].
    balls : ndarray, shape (n_bodies, 4)
        Centre and radius of a ball about the corners [m].
    planes : ndarray of int, shape (n_pairs + n_seen, 5)
        Carrier of the separating plane; mover against it; its first axis, and
        the one after the last; frame of the plane, which is the world's for
        bodies that rest.
    proxies : ndarray of int, shape (n_pairs + n_seen, 2, 2)
        Bodies that stand for these two: in every step, and where it is close.
    farthest : ndarray, shape (n_actuated,)
        Largest entry of each of these rows of ``travel``.
    placed : ndarray, shape (n_placed, POSE)
        Rows in ``poses`` of the scene's bodies: size x, y, z and rounding [m],
        rotation matrix, position [m].
    moving : ndarray of int, shape (n_moving,)
        Rows of ``placed`` of bodies that move.
    near : ndarray of int, shape (n_near,)
        Rows of ``planes`` of pairs with the scene's bodies, in the order in which
        they were built.
    """

    capsules: Array
    around: Array
    pairs: NDArray[np.int64]
    travel: Array
    exact: NDArray[np.bool_]
    bodies: NDArray[np.int64]
    corners: Array
    blocks: Array
    rounding: Array
    excess: Array
    extents: Array
    balls: Array
    planes: NDArray[np.int64]
    proxies: NDArray[np.int64]
    farthest: Array
    placed: Array
    moving: NDArray[np.int64]
    near: NDArray[np.int64]

    @classmethod
    def build(
        cls,
        arm: Arm,
        scene: Scene,
        pairs: list[tuple[int, int]],
        n_shapes: int,
    ) -> "ContactShapes":
        """Flatten the shapes of an arm in a scene.

        Parameters
        ----------
        arm, scene : Arm and Scene
            What may touch.
        pairs : list of tuple
            Shapes of each pair; the scene's bodies count from ``n_shapes``.
        n_shapes : int
            The arm's shapes.
        """
        objects = list(arm.geometry.geometryObjects)
        surroundings = [unit_body(body) for body in scene.bodies]
        bodies, links, finer = _enclosed(objects, surroundings, arm.n_joints)
        ends = np.cumsum([0, *(len(body.corners) for body in bodies)])
        blocks = list(map(corner_blocks, bodies, ends))
        edges, frames = np.cumsum([0, *map(len, blocks)]), np.array(links, dtype=np.int64)
        rows, planes, proxies = [], [], []
        travel = np.zeros((arm.n_joints, len(pairs)))
        for column, (first, second) in enumerate(pairs):
            within = second < n_shapes
            kind = BETWEEN_CAPSULES if within else surroundings[second - n_shapes].kind
            rows.append((kind, first, second))
            carrier, mover = (first, second) if within else (second, first)
            base = links[carrier] if within else 0
            moves = not within and second - n_shapes in scene.moving
            frame = links[carrier] if within or moves else 0
            if kind == WITH_HALFSPACE and _keeps_height(arm.chain, scene.bodies[second - n_shapes]):
                base = 1
            last = min(links[mover], arm.n_actuated)
            proxies.append(((carrier, mover), (finer[carrier], finer[mover])))
            planes.append((carrier, mover, base, last, frame))
            fine = bodies[finer[mover]]
            # Bodies about a shape take turns, so that all of its points count.
            aside = fine.rounding if fine.excess > 0 else 0.0
            for axis in range(base, links[mover]):
                speed = point_speed(arm.chain, axis, links[mover], fine.corners)
                travel[axis, column] = speed + (0.0 if arm.chain.prismatic[axis] else aside)
        extents = np.array(
            [(body.corners.min(axis=0), body.corners.max(axis=0)) for body in bodies]
        ).reshape(-1, 2, 3)
        middles = extents.mean(axis=1)
        radii = [
            np.sqrt(np.square(body.corners - middle).sum(axis=1).max())
            for body, middle in zip(bodies, middles, strict=True)
        ]
        exact = [isinstance(each.geometry, coal.Capsule | coal.Sphere) for each in objects]
        exact += [each.excess == 0 for each in surroundings]
        inner = map(inner_capsule, objects)
        capsules = [np.append(each.corners, each.rounding) for each in inner]
        capsules += [np.append(AXIS, 0.0 if same else -np.inf) for same in exact[len(objects) :]]
        outer = ((*each.corners, each.rounding) for each in map(outer_capsule, objects))
        around = [(*(a + b) / 2, *(b - a) / 2, radius) for a, b, radius in outer]
        return cls(
            capsules=np.array(capsules, dtype=np.float64).reshape(-1, 7),
            around=np.array(around, dtype=np.float64).reshape(-1, 7),
            pairs=np.array(rows, dtype=np.int64).reshape(-1, 3),
            travel=travel,
            exact=np.array(exact, dtype=bool),
            bodies=np.stack([ends[:-1], ends[1:], frames, edges[:-1], edges[1:]], axis=1),
            corners=np.concatenate([body.corners for body in bodies] or [np.zeros((0, 3))]),
            blocks=np.concatenate([*blocks, np.zeros((0, 4, LANES))]),
            rounding=np.array([body.rounding for body in bodies], dtype=np.float64),
            excess=np.array([body.excess for body in bodies], dtype=np.float64),
            extents=extents,
            balls=np.column_stack([middles, radii]),
            planes=np.array(planes, dtype=np.int64).reshape(-1, 5),
            proxies=np.array(proxies, dtype=np.int64).reshape(-1, 2, 2),
            farthest=travel[: arm.n_actuated].max(axis=1, initial=0.0),
            placed=np.array(list(map(placed_row, scene.bodies, surroundings))).reshape(-1, 16),
            moving=np.array(scene.moving, dtype=np.int64),
            near=np.flatnonzero([second >= n_shapes for _, second in pairs]),
        )

    def chosen(self, tested: Sequence[int], seen: Sequence[int]) -> "ContactShapes":
        """The same shapes with some of the pairs, of which some are tested, others only seen."""
        rows = np.array([*tested, *seen], dtype=np.int64)
        travel, order = np.ascontiguousarray(self.travel[:, tested]), rows.argsort()
        return self._replace(
            pairs=self.pairs[rows],
            planes=self.planes[rows],
            proxies=self.proxies[rows],
            travel=travel,
            farthest=travel[: len(self.farthest)].max(axis=1, initial=0.0),
            near=order[np.isin(rows[order], self.near)],
        )


def corner_blocks(body: Enclosure, first: int) -> Array:
    """A body's corners for `ContactShapes.blocks`, from the row of the first."""
    n = len(body.corners)
    within = np.minimum(np.arange(n + -n % LANES), n - 1)
    rows = np.column_stack([body.corners[within], first + within])
    return rows.reshape(-1, LANES, 4).transpose(0, 2, 1)


AXIS = (0.0, 0.0, -1.0, 0.0, 0.0, 1.0)
"""Axis of a capsule of the scene, before its size."""


class UnitBody(NamedTuple):
    """What the kernels know of a body of the scene, before its size.

    Attributes
    ----------
    kind : int
        Kind of its pairs with shapes of the arm.
    corners : ndarray, shape (n, 3)
        Corners of its polytope.
    size : tuple of float
        What multiplies the corners [m].
    rounding : float
        What widens the polytope then [m].
    excess : float
        See `ContactShapes.excess`; 0 if it equals its capsule, box or half-space.
    """

    kind: int
    corners: Array
    size: tuple[float, float, float]
    rounding: float
    excess: float = 0.0


CUBE = np.array(list(product((-1.0, 1.0), repeat=3)))
"""Corners of a box of the scene, before its size."""


def unit_body(body: Body) -> UnitBody:
    """A body of the scene for the kernels."""
    if body.shape == "box":
        x, y, z = body.size
        return UnitBody(WITH_BOX, CUBE, (x / 2, y / 2, z / 2), 0.0)
    if body.shape == "halfspace":
        return UnitBody(WITH_HALFSPACE, np.zeros((1, 3)), (0.0, 0.0, 0.0), 0.0)
    if body.shape == "mesh":
        corners, rounding, excess = around(np.array(body.vertices), MANY)
        return UnitBody(WITH_BOX, corners, (1.0, 1.0, 1.0), rounding, excess)
    radius, length = (*body.size, 0.0)[:2]
    if body.shape == "cylinder":
        size = (radius, radius, length / 2)
        return UnitBody(WITH_BOX, prism(1.0, 1.0), size, 0.0, np.inf)
    corners = np.array([AXIS[:3], AXIS[3:6]])
    return UnitBody(BETWEEN_CAPSULES, corners, (0.0, 0.0, length / 2), radius)


def unit_boxes(bodies: Sequence[Body]) -> Array:
    """Middle and half-size of a box around each body before its size, shape (n, 2, 3)."""
    boxes = np.zeros((len(bodies), 2, 3))
    for box, body in zip(boxes, bodies, strict=True):
        unit = unit_body(body)
        corners = CUBE if body.shape == "cylinder" else np.array(body.vertices or unit.corners)
        low, high = corners.min(axis=0), corners.max(axis=0)
        box[:] = (low + high) / 2, (high - low) / 2
        if body.shape == "mesh":
            box[1] -= unit.rounding
    return boxes


def placed_row(body: Body, unit: UnitBody) -> Array:
    """A body's row in ``poses``, shape (16,)."""
    return np.array([*unit.size, unit.rounding, *body.rotation.ravel(), *body.position])


def _enclosed(
    objects: list[pin.GeometryObject], surroundings: list[UnitBody], n_joints: int
) -> tuple[list[Enclosure], list[int], list[int]]:
    """Bodies of shapes of arm and scene, their frames, and which bodies are fine."""
    bodies = [enclosing_polytope(shape, SOME) for shape in objects]
    bodies += [Enclosure(each.corners, 0.0, each.excess) for each in surroundings]
    links, fine = [shape.parentJoint for shape in objects], list(range(len(bodies)))
    links += range(n_joints + 1, n_joints + 1 + len(surroundings))
    for index, shape in enumerate(objects):
        if len(bodies[index].corners) == SOME:
            fine[index] = len(bodies)
            bodies.append(enclosing_polytope(shape))
            links.append(links[index])
    return bodies, links, fine


def _keeps_height(chain: Chain, body: Body) -> bool:
    """Whether the first joint turns about the normal of a half-space, keeping heights."""
    if chain.prismatic[0]:
        return False
    w, x, y, z = chain.rotation[0]
    world_axis = pin.Quaternion(w, x, y, z).matrix() @ chain.axis[0]
    return bool(np.linalg.norm(np.cross(world_axis, body.rotation[:, 2])) < 1e-12)
