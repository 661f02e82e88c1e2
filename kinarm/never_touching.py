"""Proofs that two bodies never touch, wherever the joints between them are.

A box of joint positions is free if the bodies are farther apart at its centre than they can move
against each other in half of it; else it is halved. Coal measures the distances.
"""

from collections.abc import Sequence
from heapq import heappop, heappush

import numpy as np
import pinocchio as pin

from kinarm._files import cached_arrays
from kinarm.arm import Arm
from kinarm.contact_shapes import ContactShapes

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
