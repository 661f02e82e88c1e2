"""Contact of steps by Coal: at configurations, or at any time of a straight motion, by distances.

An interval of the motion is free if the pairs are farther apart in its middle than they can move in
half of it; else it is halved.
"""

from collections.abc import Iterable

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kinarm.collision import Contact, ContactModel, Step
from kinarm.episodes import Rules
from kinarm.kernels.compiling import Array

TOUCHING, TOLD_APART = 1e-6, 2.5e-7
"""Distance at which bodies touch, and motion in half an interval that is not halved [m]."""

MOST_ASKED = 20_000
"""Configurations after which a motion that slides along something counts as contact."""


def contact_in_motion(step: Step) -> Contact | None:
    """Describe the first contact on a straight way, or return None."""
    share, _ = first_share(step, 0.0, 1.0)
    if share is None:
        return None
    model, configuration = step.at(share)
    contact = model.contact(configuration)
    if contact is None:  # but closer than can be told apart
        distances, points = _distances(model, configuration, range(len(model.pair_names)))
        nearest = int(np.argmin(distances))
        contact = Contact(configuration, model.pair_names[nearest], points[nearest])
    return contact


def steps_in_contact(
    steps: Iterable[Step], doubt: NDArray[np.int64], rules: Rules
) -> tuple[NDArray[np.bool_], int]:
    """Find which steps touch something, and how many configurations were asked.

    Parameters
    ----------
    steps : iterable of Step
        The steps.
    doubt : ndarray of int, shape (n,)
        Bit k set: part k, from 0, of the step is in doubt.
    rules : Rules
        Which say whether configurations are tested or intervals.
    """
    touching, asked, parts = np.zeros(len(doubt), dtype=bool), 0, rules.parts
    for row, step in enumerate(steps):
        open_parts = np.flatnonzero(doubt[row] >> np.arange(parts) & 1).tolist()
        # Mostly the end of the last interval tells.
        for k in open_parts if rules.tested else open_parts[-1:]:
            model, end = step.at((k + 1) / parts)
            touching[row], asked = model.first_in_contact(end) is not None, asked + 1
            if touching[row]:
                break
        for k in () if rules.tested or touching[row] else open_parts:
            share, more = first_share(step, k / parts, (k + 1) / parts)
            touching[row], asked = share is not None, asked + more
            if touching[row]:
                break
    return touching, asked


def first_share(
    step: Step, low: float, high: float, *, margin: float = 0.0, most: int = MOST_ASKED
) -> tuple[float | None, int]:
    """Earliest share of a step that touches, and how many configurations were asked.

    What comes within `TOUCHING` touches, and what cannot be told from it.

    Parameters
    ----------
    step : Step
        The step.
    low, high : float
        Shares between which is looked.
    margin : float
        Distance that counts as contact, too [m].
    most : int
        Configurations after which it counts as contact.
    """
    motion = step.motion
    waiting, asked = [(low, high, np.arange(len(motion)))], 0
    while waiting:
        low, high, pairs = waiting.pop()
        middle, asked = 0.5 * (low + high), asked + 1
        distances, _ = _distances(*step.at(middle), pairs)
        reach = motion[pairs] * 0.5 * (high - low)
        near = distances - reach <= TOUCHING + margin
        if near.any():
            if reach[near].max() < TOLD_APART or asked > most:
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
