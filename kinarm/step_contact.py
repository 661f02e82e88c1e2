"""Contact of steps by Coal: at configurations, or at any time of a straight motion, by distances.

An interval of the motion is free if the pairs are farther apart in its middle than they can move in
half of it; else it is halved. Bodies of the scene may move.
"""

from collections.abc import Iterable, Iterator

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from kinarm.collision import Contact, ContactModel, Step
from kinarm.episodes import Rules
from kinarm.errors import finite_array, whole_number
from kinarm.kernels.compiling import Array
from kinarm.problem import ReachProblem

TOUCHING, TOLD_APART = 1e-6, 2.5e-7
"""Distance at which bodies touch, and motion in half an interval that is not halved [m]."""

MOST_ASKED = 20_000
"""Configurations after which a motion that slides along something counts as contact."""


class StepContact:
    """Asks Coal about steps, by the rules of a problem; for `kinarm.World`."""

    problem: ReachProblem
    rules: Rules
    contact_model: ContactModel

    def contact(
        self, configuration: ArrayLike, target: ArrayLike | None = None, *, step: int = 0
    ) -> Contact | None:
        """Describe the contact of a configuration, or the first one of a step; None if none.

        Parameters
        ----------
        configuration : array_like, shape (n_joints,)
            Where the arm is or the step begins [rad or m].
        target : array_like, shape (n_joints,), optional
            Where the step ends [rad or m].
        step : int
            Steps taken before, which tell where bodies are that move.
        """
        model, taken = self.contact_model, np.array([whole_number("step", step, 0)])
        q = finite_array("configuration", configuration, (model.arm.n_joints,))
        aim = q if target is None else finite_array("target", target, q.shape)
        scenes = model.shapes.placed[None][: len(model.shapes.moving)]
        (asked,) = self.steps_of(q[None], aim[None], scenes, taken)
        if target is None:
            model, _ = asked.at(0.0)
            return model.contact(q)
        return self.contact_of_step(asked)

    def contact_of_step(self, step: Step) -> Contact | None:
        """Describe the first contact of a step of `steps_of`, or return None."""
        if self.rules.tested:
            asked = (step.at(k / self.rules.tested) for k in range(1, self.rules.tested + 1))
            contacts = (model.contact(q) for model, q in asked)
            return next((contact for contact in contacts if contact), None)
        share, _ = first_share(step, 0.0, 1.0)
        if share is None:
            return None
        model, q = step.at(share)
        if contact := model.contact(q):
            return contact
        # It is closer than can be told apart.
        nearest = int(np.argmin(_distances(model, q, range(len(model.pair_names)))))
        found = model.workspace[1].distanceResults[nearest]
        return Contact(q, model.pair_names[nearest], np.array(found.getNearestPoint1()))

    def steps_of(
        self, starts: Array, ends: Array, scenes: Array, taken: NDArray[np.int64]
    ) -> Iterator[Step]:
        """Steps of episodes, each to be used before the next.

        Parameters
        ----------
        starts, ends : ndarray, shape (n, n_joints)
            Where the arm moves [rad or m].
        scenes : ndarray, shape (n, n_placed, 16) or (0, n_placed, 16)
            Rows of the bodies when the episodes began, if they differ or move.
        taken : ndarray of int, shape (n,)
            Steps that the episodes have taken before.
        """
        model, before = self.contact_model, self.moved(scenes, taken)
        after = self.moved(scenes, taken + 1)
        for row, (start, end) in enumerate(zip(starts, ends, strict=True)):
            if not len(scenes):
                yield Step(model, start, end)
            elif not len(model.shapes.moving):
                # They are placed once for all of the step.
                yield Step(model.at(scenes[row]), start, end)
            else:
                yield Step(model, start, end, before[row], after[row])

    def moved(self, scenes: Array, taken: NDArray[np.int64]) -> Array:
        """Rows of the bodies of episodes after some steps; see `steps_of`."""
        moving = self.contact_model.shapes.moving
        if not len(scenes) or not len(moving):
            return scenes
        rows = scenes.copy()
        rows[:, moving, 13:] += self.problem.body_offsets(taken)
        return rows

    def contact_pair(
        self, configuration: ArrayLike, target: ArrayLike | None = None, *, step: int = 0
    ) -> tuple[str, str] | None:
        """Names of the bodies of what `contact` describes, or None."""
        contact = self.contact(configuration, target, step=step)
        return contact.pair if contact else None


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
        distances = _distances(*step.at(middle), pairs)
        reach = motion[pairs] * 0.5 * (high - low)
        near = distances - reach <= TOUCHING + margin
        if near.any():
            if reach[near].max() < TOLD_APART or asked > most:
                return middle, asked
            # The last one is looked at first.
            waiting += [(middle, high, pairs[near]), (low, middle, pairs[near])]
    return None, asked


def _distances(model: ContactModel, configuration: Array, pairs: Iterable[int]) -> Array:
    """Distances of some pairs [m], which Coal's data keep."""
    data, placed, *_ = model.workspace
    pin.updateGeometryPlacements(model.arm.model, data, model.geometry, placed, configuration)
    distances = (pin.computeDistance(model.geometry, placed, int(pair)) for pair in pairs)
    return np.array([each.min_distance for each in distances])
