"""Contact between the arm, the scene and itself: Coal decides, enclosing shapes prove freedom.

`ContactModel` holds one list of pairs twice: as a Pinocchio/Coal geometry model, which decides, and
as flat arrays (`ContactShapes`), from which kernels prove most configurations.
"""

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kinarm.arm import Arm
from kinarm.contact_pairs import (
    NEVER_TOUCH,
    body_names,
    candidate_pairs,
    make_verdicts_reliable,
    never_touching,
    start_anew,
    uninformative_pairs,
)
from kinarm.contact_shapes import ContactShapes
from kinarm.meshes import coal_shape
from kinarm.scene import Scene


class Contact(NamedTuple):
    """Two bodies that touch.

    Attributes
    ----------
    configuration : ndarray, shape (n_joints,)
        Joint positions [rad or m].
    pair : tuple of str
        Their names.
    point : ndarray, shape (3,)
        Where, in the world [m].
    """

    configuration: NDArray[np.float64]
    pair: tuple[str, str]
    point: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Step:
    """A straight motion of the arm, and of bodies of the scene.

    Attributes
    ----------
    model : ContactModel
        The arm in the scene.
    start, end : ndarray, shape (n_joints,)
        Where the arm moves [rad or m].
    before, after : ndarray, shape (n_placed, 16), optional
        Rows of the scene's bodies, if they are not where the model has them.
    """

    model: "ContactModel"
    start: NDArray[np.float64]
    end: NDArray[np.float64]
    before: NDArray[np.float64] | None = None
    after: NDArray[np.float64] | None = None

    def at(self, share: float) -> tuple["ContactModel", NDArray[np.float64]]:
        """The model when a share of it is over, until the next call, and the configuration."""
        model, over = self.model, share == 1.0
        if self.before is not None and self.after is not None:
            rows = self.before + share * (self.after - self.before)
            model = model.at(self.after if over else rows)
        return model, self.end if over else self.start + share * (self.end - self.start)

    @property
    def motion(self) -> NDArray[np.float64]:
        """Largest motion of the bodies of each pair against each other, shape (n_pairs,) [m]."""
        shapes = self.model.shapes
        moved = np.abs(self.end - self.start)[:, None]
        motion: NDArray[np.float64] = (moved * shapes.travel).sum(axis=0)
        if self.before is not None and self.after is not None:
            ways = np.linalg.norm(self.after[:, 13:] - self.before[:, 13:], axis=1)
            others = shapes.pairs[: len(motion), 2] - (len(shapes.capsules) - len(ways))
            motion += np.where(others < 0, 0.0, ways[np.maximum(others, 0)])
        return motion


@dataclass(frozen=True, eq=False)
class ContactModel:
    """An arm in a scene, with the pairs of bodies that are tested for contact.

    Left out are neighbours in the chain, bodies that overlap at the home pose,
    those that the arm's file allows, those that are proven never to touch within
    the joints' limits, and the mounting: the base, and the first link and ground
    that always touch. A configuration is an array of shape (n_joints,) [rad or m].

    Attributes
    ----------
    arm, geometry : Arm and pinocchio.GeometryModel
        The arm, and shapes of arm and scene with the pairs.
    body_names : tuple of str
        Readable name of each of these shapes.
    shapes : ContactShapes
        The same pairs for the kernels.
    left_out : dict
        Reasons why moving pairs are left out, by the names of bodies.
    movable : bool
        Whether `at` moves its bodies.
    """

    arm: Arm
    geometry: pin.GeometryModel
    body_names: tuple[str, ...]
    shapes: ContactShapes
    left_out: dict[tuple[str, str], str]
    movable: bool = False

    def __post_init__(self) -> None:
        for array in self.shapes:
            array.flags.writeable = False

    @classmethod
    def build(cls, arm: Arm, scene: Scene, *, loose: bool = False) -> "ContactModel":
        """Place an arm in a scene and choose the pairs to test.

        Loose obstacles may be put anywhere, also against the base. Raises ProblemError if the first
        link touches an obstacle wherever its joint is.
        """
        geometry = arm.geometry.copy()
        n_shapes = geometry.ngeoms
        for body in scene.bodies:
            place = pin.SE3(body.rotation, np.array(body.position))
            geometry.addGeometryObject(pin.GeometryObject(body.name, 0, place, coal_shape(body)))
        surroundings = [shape.name for shape in geometry.geometryObjects][n_shapes:]
        fixed = n_shapes + len(scene.obstacles)
        placed = range(n_shapes, fixed if loose else n_shapes)
        candidates = candidate_pairs(arm, geometry, n_shapes, placed)
        for pair in candidates:
            geometry.addCollisionPair(pin.CollisionPair(*pair))
        names = (*body_names(arm), *surroundings)
        last = fixed + sum(each.count[1] for each in scene.random_bodies)
        anywhere = {*placed, *range(fixed, last), *(n_shapes + k for k in scene.moving)}
        dropped = uninformative_pairs(arm, geometry, n_shapes, names, anywhere)
        shapes = ContactShapes.build(arm, scene, candidates, n_shapes)
        asked = [
            index
            for index, (_, other) in enumerate(candidates)
            if index not in dropped and other not in anywhere
        ]
        # What is proven of an arm alone holds in every scene.
        within = sum(candidates[index][1] < n_shapes for index in asked)
        own, others = (
            never_touching(arm, geometry, shapes, some) for some in (asked[:within], asked[within:])
        )
        dropped |= dict.fromkeys(own + others, NEVER_TOUCH)
        kept = [index for index in range(len(candidates)) if index not in dropped]
        links = [shape.parentJoint for shape in geometry.geometryObjects]
        seen = [index for index in others if links[candidates[index][0]] > 1]
        geometry.removeAllCollisionPairs()
        for index in kept:
            geometry.addCollisionPair(pin.CollisionPair(*candidates[index]))
        return cls(
            arm=arm,
            geometry=geometry,
            body_names=names,
            shapes=shapes.chosen(kept, seen),
            left_out={
                (names[first], names[second]): dropped[index]
                for index, (first, second) in enumerate(candidates)
                if index in dropped
            },
        )

    @cached_property
    def _coal(self) -> pin.TreeBroadPhaseManagerPool_DynamicAABBTreeCollisionManager:
        pool = pin.TreeBroadPhaseManagerPool_DynamicAABBTreeCollisionManager(
            self.arm.model, self.geometry, 1
        )
        make_verdicts_reliable(pool.getBroadPhaseManager(0).getGeometryData())
        return pool

    @cached_property
    def workspace(
        self,
    ) -> tuple[pin.Data, pin.GeometryData, list[coal.CollisionRequest], list[coal.CollisionResult]]:
        """Data of Pinocchio and Coal, and requests and results of each pair."""
        data = make_verdicts_reliable(self.geometry.createData())
        # Lists, since wrapping a request or result takes longer than the test itself.
        requests, results = list(data.collisionRequests), list(data.collisionResults)
        start_anew(requests)
        return self.arm.model.createData(), data, requests, results

    @cached_property
    def pair_names(self) -> tuple[tuple[str, str], ...]:
        """Names of the two bodies of each tested pair."""
        return tuple(
            (self.body_names[pair.first], self.body_names[pair.second])
            for pair in self.geometry.collisionPairs
        )

    def at(self, scene: NDArray[np.float64]) -> "ContactModel":
        """The same model with the scene's bodies elsewhere, until the next call.

        Takes rows as in ``shapes.placed``, shape (n_placed, 16).
        """
        self._movable._move(scene)
        return self._movable

    def fixed(self, scene: NDArray[np.float64]) -> "ContactModel":
        """A model of its own of such a scene."""
        shapes = self.shapes._replace(placed=scene.copy())
        model = replace(self, geometry=self.geometry.clone(), shapes=shapes)
        model._move(scene)
        return model

    def _move(self, scene: NDArray[np.float64]) -> None:
        """Move the shapes of the scene's bodies in Coal."""
        placed = list(self.geometry.geometryObjects)[self.arm.geometry.ngeoms :]
        for row, each in zip(scene, placed, strict=True):
            body = each.geometry
            if isinstance(body, coal.Box):
                body.halfSide = row[:3]
            elif isinstance(body, coal.Sphere | coal.Capsule):
                body.radius = row[3]
            elif isinstance(body, coal.Cylinder):
                body.radius = row[0]
            if isinstance(body, coal.Capsule | coal.Cylinder):
                body.halfLength = row[2]
            each.placement = pin.SE3(row[4:13].reshape(3, 3), row[13:])

    @cached_property
    def _movable(self) -> "ContactModel":
        return replace(self, geometry=self.geometry.clone(), movable=True)

    def touching(
        self, configurations: NDArray[np.float64], scenes: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """`in_contact`, each in a scene of its own, shape (n, n_placed, 16), if there are any."""
        if not len(scenes):
            return self.in_contact(configurations)
        pairs = zip(configurations, scenes, strict=True)
        found = [self.at(scene).first_in_contact(each) is not None for each, scene in pairs]
        return np.array(found, dtype=bool)

    def in_contact(self, configurations: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Ask Coal which configurations, shape (n, n_joints), touch something."""
        if len(configurations) == 0:
            return np.zeros(0, dtype=bool)
        columns = np.asfortranarray(configurations.T)
        verdicts = pin.computeCollisionsInParallel(1, self._coal, columns, True)
        return np.array(verdicts, dtype=bool).reshape(-1)

    def contact_pair(self, configuration: NDArray[np.float64]) -> tuple[str, str] | None:
        """Name the first tested pair that is in contact, or None."""
        index = self.first_in_contact(configuration)
        return None if index is None else self.pair_names[index]

    def contact(self, configuration: NDArray[np.float64]) -> Contact | None:
        """Describe the first pair in contact, or return None."""
        index = self.first_in_contact(configuration)
        if index is None:
            return None
        point = np.array(self.workspace[3][index].getContact(0).pos)
        return Contact(configuration, self.pair_names[index], point)

    def first_in_contact(self, configuration: NDArray[np.float64]) -> int | None:
        """Index of the first tested pair that is in contact, or None."""
        if not self.movable and not self.in_contact(configuration[None])[0]:
            return None
        data, geometry_data, requests, results = self.workspace
        asked = (self.arm.model, data, self.geometry, geometry_data, configuration, True)
        index = None
        if pin.computeCollisions(*asked):
            # Pairs are tested in order up to the first in contact; later results are older.
            index = next(index for index, result in enumerate(results) if result.isCollision())
        start_anew(requests[: len(requests) if index is None else index + 1])
        return index

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        return type(self), tuple(getattr(self, item.name) for item in fields(self))
