"""Contact between the arm, the scene and itself: Coal decides, enclosing shapes prove freedom.

`ContactModel` holds one list of pairs twice: as a Pinocchio/Coal geometry model, which decides, and
as flat arrays (`ContactShapes`), from which kernels prove most configurations.
"""

import warnings
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, fields
from functools import cached_property
from itertools import combinations, product
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kinarm.arm import Arm
from kinarm.contact_shapes import ContactShapes
from kinarm.errors import ProblemError
from kinarm.meshes import coal_shape
from kinarm.scene import Scene

CLOSE, OFTEN, CLOSENESS_SAMPLES = 0.025, 0.1, 200
"""Close pairs are nearer than this [m] in more than this share of these samples."""

GUESS, HINT = np.array([1.0, 0.0, 0.0]), np.zeros(2, dtype=np.int32)
"""Starts of Coal's searches: direction between shapes, and numbers of corners."""

FEW = 4
"""Of up to so many steps in doubt, Coal tells what touches."""

TOUCH_AT_HOME = "touch at home"
"""Why a pair of an arm is never tested."""

MOUNT_SAMPLES = 721
"""Positions of the first joint that test the mounting."""


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
class ContactModel:
    """An arm in a scene, with the pairs of bodies that are tested for contact.

    Left out are neighbours in the chain, bodies that overlap at the home pose,
    those that the arm's file allows, and the mounting: base and first link
    against a world that they never touch or always touch. A configuration is an
    array of shape (n_joints,) [rad or m].

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
    """

    arm: Arm
    geometry: pin.GeometryModel
    body_names: tuple[str, ...]
    shapes: ContactShapes
    left_out: dict[tuple[str, str], str]

    def __post_init__(self) -> None:
        for array in self.shapes:
            array.flags.writeable = False

    @classmethod
    def build(cls, arm: Arm, scene: Scene) -> "ContactModel":
        """Place an arm in a scene and choose the pairs to test.

        Raises ProblemError if the first link touches an obstacle wherever its joint is.
        """
        geometry = arm.geometry.copy()
        n_shapes = geometry.ngeoms
        _add_scene(geometry, scene)
        surroundings = [shape.name for shape in geometry.geometryObjects][n_shapes:]
        candidates = _candidate_pairs(arm, geometry, n_shapes)
        for pair in candidates:
            geometry.addCollisionPair(pin.CollisionPair(*pair))
        names = (*body_names(arm), *surroundings)
        dropped = _uninformative_pairs(arm, geometry, n_shapes, names)
        kept = [pair for index, pair in enumerate(candidates) if index not in dropped]
        geometry.removeAllCollisionPairs()
        for pair in kept:
            geometry.addCollisionPair(pin.CollisionPair(*pair))
        return cls(
            arm=arm,
            geometry=geometry,
            body_names=names,
            shapes=ContactShapes.build(arm, scene, kept, n_shapes, _close_pairs(arm, geometry)),
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
    def workspace(self) -> tuple[pin.Data, pin.GeometryData, list[coal.CollisionResult]]:
        """Data of Pinocchio and Coal, and results of each pair."""
        data = make_verdicts_reliable(self.geometry.createData())
        # A list, since wrapping results takes longer than the test itself.
        return self.arm.model.createData(), data, list(data.collisionResults)

    @cached_property
    def pair_names(self) -> tuple[tuple[str, str], ...]:
        """Names of the two bodies of each tested pair."""
        return tuple(
            (self.body_names[pair.first], self.body_names[pair.second])
            for pair in self.geometry.collisionPairs
        )

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
        point = np.array(self.workspace[2][index].getContact(0).pos)
        return Contact(configuration, self.pair_names[index], point)

    def first_in_contact(self, configuration: NDArray[np.float64]) -> int | None:
        """Index of the first tested pair that is in contact, or None."""
        if not self.in_contact(configuration[None])[0]:
            return None
        data, geometry_data, results = self.workspace
        start_anew(geometry_data.collisionRequests)
        pin.computeCollisions(
            self.arm.model, data, self.geometry, geometry_data, configuration, True
        )
        # Pairs are tested in order up to the first in contact; later results are of other calls.
        return next(index for index, result in enumerate(results) if result.isCollision())

    def first_contacts(
        self, ways: NDArray[np.float64], doubt: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], int]:
        """Find what steps touch first that are proven neither free nor in contact.

        Coal is asked in the order of the motion, up to the first contact.

        Parameters
        ----------
        ways : ndarray, shape (n, n_tested, n_joints)
            Configurations in the order of the motion [rad or m].
        doubt : ndarray of int, shape (n,)
            Bit k set: configuration k, from 0, is in doubt.

        Returns
        -------
        touched : ndarray of int, shape (n,)
            Numbers of pairs, from 1; -1 for unknown ones, 0 without contact.
        asked : int
            Configurations that Coal was asked about.
        """
        touched, asked = np.zeros(len(ways), dtype=np.int64), 0
        for k in range(ways.shape[1]):
            rows = np.flatnonzero((doubt & 1 << k != 0) & (touched == 0))
            if rows.size:
                hit = rows[self.in_contact(ways[rows, k])]
                touched[hit] = -1
                asked += rows.size
                for row in hit if len(ways) <= FEW else ():
                    index = self.first_in_contact(ways[row, k])
                    touched[row] = -1 if index is None else index + 1
        return touched, asked

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        return type(self), tuple(getattr(self, item.name) for item in fields(self))


def make_verdicts_reliable(data: pin.GeometryData) -> pin.GeometryData:
    """Make Coal's verdicts reliable and a function of the configuration alone; return the data.

    By default Coal starts where its last call on the same pair ended, and verdicts within its
    tolerance of 1e-6 m depend on that. A guess in the request, which `start_anew` puts back,
    replaces it. Without a description of the contact, Coal may stop at a distance of some 1e-7 m
    and call bodies apart that are centimetres deep in each other, once in some 100 000 times.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        for request in data.collisionRequests:
            request.enable_cached_gjk_guess = False
            request.gjk_initial_guess = coal.GJKInitialGuess.CachedGuess
            request.enable_contact = True
    return data


def start_anew(requests: Iterable[coal.CollisionRequest]) -> None:
    """Let Coal's next searches start where all do."""
    for request in requests:
        request.cached_gjk_guess, request.cached_support_func_guess = GUESS, HINT


def _add_scene(geometry: pin.GeometryModel, scene: Scene) -> None:
    """Add the bodies of a scene to a geometry model."""
    for body in scene.bodies:
        placement = pin.SE3(body.rotation, np.array(body.position))
        geometry.addGeometryObject(pin.GeometryObject(body.name, 0, placement, coal_shape(body)))


def link_of(shape: pin.GeometryObject) -> str:
    """Link of a collision shape."""
    return str(shape.name.rsplit("_", 1)[0])


def body_names(arm: Arm) -> tuple[str, ...]:
    """Links of the collision shapes, numbered only where a link has several."""
    shapes = list(arm.geometry.geometryObjects)
    count = Counter(map(link_of, shapes))
    return tuple(link_of(shape) if count[link_of(shape)] == 1 else shape.name for shape in shapes)


def are_neighbours(arm: Arm, first: pin.GeometryObject, second: pin.GeometryObject) -> bool:
    """Whether a joint joins the links of two shapes; held bodies have no neighbours."""
    held = {body.name for body in arm.held_bodies}
    apart = abs(first.parentJoint - second.parentJoint)
    return apart == 1 and not held & {link_of(first), link_of(second)}


def _candidate_pairs(arm: Arm, geometry: pin.GeometryModel, n_shapes: int) -> list[tuple[int, int]]:
    """All pairs that move against each other, but those that are allowed."""
    shapes = list(geometry.geometryObjects)
    parent, links = [shape.parentJoint for shape in shapes], list(map(link_of, shapes))
    allowed = {frozenset(contact.links) for contact in arm.allowed_contacts}
    pairs = []
    for first, second in combinations(range(n_shapes), 2):
        alike = parent[first] == parent[second] or {links[first], links[second]} in allowed
        if not alike and not are_neighbours(arm, shapes[first], shapes[second]):
            pairs.append((first, second) if parent[first] < parent[second] else (second, first))
    moving = [shape for shape in range(n_shapes) if parent[shape] > 0]
    flat = [isinstance(each.geometry, coal.Halfspace) for each in shapes]
    with_world = product(moving, range(n_shapes, geometry.ngeoms))
    # Kind after kind, which the kernels find easier to predict.
    return pairs + sorted(with_world, key=lambda pair: flat[pair[1]])


def _uninformative_pairs(
    arm: Arm, geometry: pin.GeometryModel, n_shapes: int, names: tuple[str, ...]
) -> dict[int, str]:
    """Pairs within the arm that touch at home, and of the mounting, with reasons.

    The mounting is the first link against the world, where it touches never, or the ground always,
    at 721 positions along the range of the first joint.
    """
    data, geometry_data = arm.model.createData(), make_verdicts_reliable(geometry.createData())
    pairs, objects = list(geometry.collisionPairs), geometry.geometryObjects

    def touching(q: NDArray[np.float64], chosen: Iterable[int]) -> set[int]:
        """Indices of chosen pairs in contact at a configuration."""
        pin.updateGeometryPlacements(arm.model, data, geometry, geometry_data, q)
        start_anew(geometry_data.collisionRequests[index] for index in chosen)
        return {index for index in chosen if pin.computeCollision(geometry, geometry_data, index)}

    within = [index for index, pair in enumerate(pairs) if pair.second < n_shapes]
    resting = touching(arm.home, within)
    mounting = {
        index
        for index, pair in enumerate(pairs)
        if pair.second >= n_shapes and objects[pair.first].parentJoint == 1
    }
    always, never = set(mounting), set(mounting)
    q = arm.home.copy()
    for position in np.linspace(arm.lower[0], arm.upper[0], MOUNT_SAMPLES if mounting else 0):
        q[0] = position
        now = touching(q, mounting)
        always &= now
        never -= now
    for index in sorted(always):
        if not isinstance(objects[pairs[index].second].geometry, coal.Halfspace):
            raise ProblemError(
                f"arm {arm.name!r} cannot move: {names[pairs[index].first]} touches "
                f"{names[pairs[index].second]} wherever the first joint is"
            )
    return {
        **dict.fromkeys(resting, TOUCH_AT_HOME),
        **dict.fromkeys(always, "the mounting: always touch"),
        **dict.fromkeys(never, "never touch, wherever the first joint is"),
    }


def _close_pairs(arm: Arm, geometry: pin.GeometryModel) -> set[int]:
    """Pairs with a mesh that often are less than `CLOSE` apart."""
    objects = geometry.geometryObjects
    meshes = [isinstance(shape.geometry, coal.ConvexBase) for shape in objects]
    pairs = [
        index
        for index, pair in enumerate(geometry.collisionPairs)
        if meshes[pair.first] or meshes[pair.second]
    ]
    if not pairs:
        return set()
    data, distances = arm.model.createData(), geometry.createData()
    rng, often = np.random.default_rng(0), dict.fromkeys(pairs, 0)
    for _ in range(CLOSENESS_SAMPLES):
        q = arm.home.copy()
        moved = slice(arm.n_actuated)
        q[moved] = rng.uniform(arm.lower[moved], arm.upper[moved])
        pin.updateGeometryPlacements(arm.model, data, geometry, distances, q)
        for index in pairs:
            result = pin.computeDistance(geometry, distances, index)
            often[index] += result.min_distance < CLOSE
    return {index for index in pairs if often[index] > OFTEN * CLOSENESS_SAMPLES}
