"""Contact at any time of a straight motion, by distances that Coal measures.

An interval of the motion is free if the pairs are farther apart in its middle than they can move in
half of it; else it is halved.
"""

from collections.abc import Iterable

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kinarm.collision import Contact, ContactModel
from kinarm.kernels.compiling import Array
from kinarm.kernels.proof import INTERVALS

TOUCHING, TOLD_APART = 1e-6, 2.5e-7
"""Distance at which bodies touch, and motion in half an interval that is not halved [m]."""

MOST_ASKED = 20_000
"""Configurations after which a motion that slides along something counts as contact."""


def contact_in_motion(model: ContactModel, start: Array, end: Array) -> Contact | None:
    """Describe the first contact on a straight way, or return None.

    Parameters
    ----------
    model : ContactModel
        An arm in a scene.
    start, end : ndarray, shape (n_joints,)
        Where it moves [rad or m].
    """
    share, _ = first_share(model, start, end, 0.0, 1.0)
    if share is None:
        return None
    configuration = start + share * (end - start)
    contact = model.contact(configuration)
    if contact is None:  # but closer than can be told apart
        distances, points = _distances(model, configuration, range(len(model.pair_names)))
        nearest = int(np.argmin(distances))
        contact = Contact(configuration, model.pair_names[nearest], points[nearest])
    return contact


def motions_in_contact(
    model: ContactModel, starts: Array, ends: Array, doubt: NDArray[np.int64], scenes: Array
) -> tuple[NDArray[np.int64], int]:
    """Find which steps touch something; results are those of `ContactModel.first_contacts`.

    Parameters
    ----------
    model : ContactModel
        An arm in a scene.
    starts, ends : ndarray, shape (n, n_joints)
        Of the steps [rad or m].
    doubt : ndarray of int, shape (n,)
        Bit k set: interval k, from 0, of `INTERVALS` is in doubt.
    scenes : ndarray, shape (n, n_placed, 16)
        As for `ContactModel.touching`.
    """
    touched, asked = np.zeros(len(starts), dtype=np.int64), 0
    for row, (start, end) in enumerate(zip(starts, ends, strict=True)):
        there = model.of_row(scenes, row)
        for k in np.flatnonzero(doubt[row] >> np.arange(INTERVALS) & 1).tolist():
            low, high = k / INTERVALS, (k + 1) / INTERVALS
            # Mostly the end of an interval tells, which is asked sooner than when it began.
            hit, more = there.first_in_contact(start + high * (end - start)) is not None, 0
            if not hit:
                share, more = first_share(there, start, end, low, high)
                hit = share is not None
            asked += 1 + more
            if hit:
                touched[row] = -1
                break
    return touched, asked


def first_share(
    model: ContactModel, start: Array, end: Array, low: float, high: float
) -> tuple[float | None, int]:
    """Earliest share of a straight way that touches, and how many configurations were asked.

    What comes within `TOUCHING` touches, and what cannot be told from it.

    Parameters
    ----------
    model, start, end
        As for `contact_in_motion`.
    low, high : float
        Shares between which is looked.
    """
    speeds = np.abs(end - start)[: model.arm.n_actuated] @ model.shapes.travel
    waiting, asked = [(low, high, np.arange(len(speeds)))], 0
    while waiting:
        low, high, pairs = waiting.pop()
        middle, asked = 0.5 * (low + high), asked + 1
        distances, _ = _distances(model, start + middle * (end - start), pairs)
        reach = speeds[pairs] * 0.5 * (high - low)
        near = distances - reach <= TOUCHING
        if near.any():
            if reach[near].max() < TOLD_APART or asked > MOST_ASKED:
                return middle, asked
            # The last one is looked at first.
            waiting += [(middle, high, pairs[near]), (low, middle, pairs[near])]
    return None, asked


def _distances(
    model: ContactModel, configuration: Array, pairs: Iterable[int]
) -> tuple[Array, list[Array]]:
    """Distances of some pairs, and the closest point of the first body of each [m]."""
    data, placed = model.workspace[0], model.measuring
    pin.updateGeometryPlacements(model.arm.model, data, model.geometry, placed, configuration)
    found = [pin.computeDistance(model.geometry, placed, int(pair)) for pair in pairs]
    points = [np.array(each.getNearestPoint1()) for each in found]
    return np.array([each.min_distance for each in found]), points
