"""Which pairs of shapes are tested for contact, and how Coal is asked about them.

Two bodies that never touch, wherever the joints between them are, need no test. A box of joint
positions is free if the bodies are farther apart at its centre than they can move against each
other in half of it; else it is halved. Coal measures the distances.
"""

import warnings
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from heapq import heappop, heappush
from itertools import combinations, product

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kinarm._files import cached_arrays
from kinarm.arm import Arm
from kinarm.contact_shapes import ContactShapes
from kinarm.errors import ProblemError

GUESS, HINT = np.array([1.0, 0.0, 0.0]), np.zeros(2, dtype=np.int32)
"""Starts of Coal's searches: direction between shapes, and numbers of corners."""

TOUCH_AT_HOME = "touch at home"
"""Why a pair of an arm is never tested."""

MOUNT_SAMPLES = 721
"""Positions of the first joint that test the mounting."""

NEVER_TOUCH = "proven never to touch"
"""Why such a pair is not tested."""

PROOFS = 1
"""To be raised when other pairs are proven for the same arm and scene."""

CLOSE, BEYOND = 1e-3, 0.1
"""Distance that is not enough [m], and how far joints may be beyond their limits [rad or m]."""

MOST_JOINTS, MOST_ASKED, MOST_ASKED_OF_SCENE = 4, 60_000, 5_000
"""Joints between bodies of an arm, and configurations, beyond which no proof is sought.

Of the scene's bodies, fewer are asked, since scenes change more often than arms.
"""


def make_verdicts_reliable(data: pin.GeometryData) -> pin.GeometryData:
    """Make Coal's answers reliable and functions of the configuration alone; return the data.

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
        for request in data.distanceRequests:
            request.enable_cached_gjk_guess = False
    return data


def start_anew(requests: Iterable[coal.CollisionRequest]) -> None:
    """Let Coal's next searches start where all do."""
    for request in requests:
        request.cached_gjk_guess, request.cached_support_func_guess = GUESS, HINT


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


def candidate_pairs(
    arm: Arm, geometry: pin.GeometryModel, n_shapes: int, loose: range
) -> list[tuple[int, int]]:
    """All pairs that move against each other, but those that are allowed.

    Among them are the base and loose obstacles that it does not stand on.
    """
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
    with_world = [*product(moving, range(n_shapes, geometry.ngeoms))]
    for pair in product((shape for shape in range(n_shapes) if parent[shape] == 0), loose):
        base, obstacle = (shapes[each] for each in pair)
        placed = (base.geometry, base.placement, obstacle.geometry, obstacle.placement)
        if not coal.collide(*placed, coal.CollisionRequest(), coal.CollisionResult()):
            with_world.append(pair)
    # Kind after kind, which the kernels find easier to predict.
    return pairs + sorted(with_world, key=lambda pair: flat[pair[1]])


def uninformative_pairs(
    arm: Arm,
    geometry: pin.GeometryModel,
    n_shapes: int,
    names: tuple[str, ...],
    anywhere: Collection[int],
) -> dict[int, str]:
    """Pairs within the arm that touch at home, and of the mounting, with reasons.

    The mounting is the first link against the ground where it always touches, at 721 positions
    along the range of the first joint. Some bodies may be anywhere.
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
    always = {
        index
        for index, pair in enumerate(pairs)
        if pair.second >= n_shapes and pair.second not in anywhere
        if objects[pair.first].parentJoint == 1
    }
    q = arm.home.copy()
    for position in np.linspace(arm.lower[0], arm.upper[0], MOUNT_SAMPLES):
        if not always:
            break
        q[0] = position
        always = touching(q, always)
    for index in sorted(always):
        if not isinstance(objects[pairs[index].second].geometry, coal.Halfspace):
            raise ProblemError(
                f"arm {arm.name!r} cannot move: {names[pairs[index].first]} touches "
                f"{names[pairs[index].second]} wherever the first joint is"
            )
    return {
        **dict.fromkeys(resting, TOUCH_AT_HOME),
        **dict.fromkeys(always, "the mounting: always touch"),
    }


def never_touching(
    arm: Arm, geometry: pin.GeometryModel, shapes: ContactShapes, asked: Sequence[int]
) -> list[int]:
    """Those of some pairs that are proven never to touch, through the cache.

    Parameters
    ----------
    arm, geometry, shapes : Arm, pinocchio.GeometryModel and ContactShapes
        The arm, and the same shapes of arm and scene for Coal and for the kernels.
    asked : sequence of int
        Rows of ``shapes.pairs`` of bodies that rest, or move with the arm.
    """
    rows = np.array(asked, dtype=np.int64)
    of_pairs = shapes.pairs[rows], shapes.planes[rows, 1:3], shapes.travel[:, rows]
    arrays = [*arm.chain, *of_pairs]
    if (shapes.pairs[rows, 2] >= arm.geometry.ngeoms).any():
        arrays += [shapes.placed, shapes.bodies, shapes.corners]
    made_of = arm.digest.encode() + b"".join(array.tobytes() for array in arrays)
    found = cached_arrays(
        "apart",
        PROOFS,
        made_of,
        lambda: {"proven": [_never_touch(arm, geometry, shapes, pair) for pair in asked]},
    )
    return [pair for pair, proven in zip(asked, found["proven"], strict=True) if proven]


def _never_touch(arm: Arm, geometry: pin.GeometryModel, shapes: ContactShapes, pair: int) -> bool:
    """Whether a pair is proven never to touch."""
    mover, first = shapes.planes[pair, 1:3]
    joints = slice(first, shapes.bodies[mover, 2])
    own = shapes.pairs[pair, 2] < arm.geometry.ngeoms
    most = MOST_ASKED if own else MOST_ASKED_OF_SCENE
    lower, upper, speed = arm.lower[joints], arm.upper[joints], shapes.travel[joints, pair]
    if len(speed) > MOST_JOINTS:
        return False
    two = pin.GeometryModel()
    for shape in shapes.pairs[pair, 1:]:
        two.addGeometryObject(geometry.geometryObjects[int(shape)])
    two.addCollisionPair(pin.CollisionPair(0, 1))
    data, placed, q = arm.model.createData(), two.createData(), arm.home.copy()

    def distance(position: np.ndarray) -> float:
        q[joints] = position
        pin.updateGeometryPlacements(arm.model, data, two, placed, q)
        return float(pin.computeDistance(two, placed, 0).min_distance)

    circle = (upper - lower >= 2 * np.pi) & ~arm.chain.prismatic[joints]
    half = np.where(circle, np.pi, (upper - lower) / 2 + BEYOND)
    centre = (lower + upper) / 2
    # The box that leaves most in doubt comes first, so that contact is found soon.
    waiting, n = [(distance(centre) - speed @ half, 0, centre, half)], 1
    while waiting[0][0] <= CLOSE:
        bound, _, centre, half = heappop(waiting)
        if bound + speed @ half <= CLOSE or n > most:
            return False
        widest = int(np.argmax(speed * half))
        part = np.where(np.arange(len(half)) == widest, half / 2, half)
        for side in (-1, 1):
            other = centre + side * (half - part)
            heappush(waiting, (distance(other) - speed @ part, n, other, part))
            n += 1
    return True


def random_configurations(arm: Arm, count: int, seed: int = 0) -> NDArray[np.float64]:
    """Configurations, shape (count, n_joints), actuated joints uniform within their limits.

    Others stay at home [rad or m].
    """
    q, moved = np.tile(arm.home, (count, 1)), slice(arm.n_actuated)
    uniforms = np.random.default_rng(seed).random((count, arm.n_actuated))
    q[:, moved] = arm.lower[moved] + uniforms * (arm.upper - arm.lower)[moved]
    return q
