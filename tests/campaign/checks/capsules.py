"""Distances of capsules and boxes by their definition: the judge where engines differ."""

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from kinarm.world import World


def capsule_box_distance(
    world: World, configuration: NDArray[np.float64], pair: int
) -> float | None:
    """Distance of a tested pair's capsule from its box, minus the radius inside; None for others.

    Parameters
    ----------
    world : World
        Arm and scene.
    configuration : ndarray, shape (n_joints,)
        Where the arm is [rad or m].
    pair : int
        Number of the pair.

    Returns
    -------
    float or None
        The distance [m]; negative where they overlap.
    """
    geometry, model = world.contact_model.geometry, world.arm.model
    data, placed = model.createData(), geometry.createData()
    pin.updateGeometryPlacements(model, data, geometry, placed, configuration)
    numbers = geometry.collisionPairs[pair].first, geometry.collisionPairs[pair].second
    shapes = {
        type(geometry.geometryObjects[number].geometry): (
            geometry.geometryObjects[number].geometry,
            placed.oMg[number],
        )
        for number in numbers
    }
    if set(shapes) != {coal.Capsule, coal.Box}:
        return None
    (capsule, held), (box, standing) = shapes[coal.Capsule], shapes[coal.Box]

    def outside(along: float) -> float:
        """How far a point of the capsule's axis is from the box; a convex function."""
        point = standing.actInv(held.act(np.array([0.0, 0.0, along])))
        return float(np.linalg.norm(np.maximum(np.abs(point) - box.halfSide, 0.0)))

    ends = -capsule.halfLength, capsule.halfLength
    found = minimize_scalar(outside, bounds=ends, method="bounded", options={"xatol": 1e-12})
    return min(found.fun, *map(outside, ends)) - float(capsule.radius)
