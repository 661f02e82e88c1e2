"""Which straight motions of an arm are free of contact, at any time and with a margin."""

import numpy as np

from kinarm.collision import Step
from kinarm.contact_shapes import ContactShapes
from kinarm.kernels.compiling import Array
from kinarm.kernels.lanes import LANES
from kinarm.kernels.records import recorded
from kinarm.kernels.work_space import furnish, sizes_of, work_space
from kinarm.policies.planning.kernels.sweeping import sweep
from kinarm.step_contact import first_share
from kinarm.world import World

BEND = 0.1
"""Bend of a part of a motion at most, from which parts have their length [m]."""

MOST_ASKED = 64
"""Configurations that Coal is asked about for a part that is not proven free, at most."""


class Motions:
    """Straight motions of an arm among bodies that rest.

    Parameters
    ----------
    world : World
        The arm in its scene, whose bodies neither move nor are random.
    margin : float
        Distance that all tested pairs of bodies keep [m].

    Attributes
    ----------
    moved : int
        Joints that move, the first ones.
    speeds : ndarray, shape (moved,)
        Their velocity limits [rad/s or m/s].
    farthest : ndarray, shape (moved,)
        How far each moves bodies at most [m/rad, or m/m].
    """

    def __init__(self, world: World, margin: float = 0.0) -> None:
        self.world, self.margin, self.moved = world, margin, world.n_actions
        shapes = widened(world.contact_model.shapes, margin)
        self._chain, self._shapes = world.records[0], recorded(shapes)
        joints = {"n_joints": world.arm.n_joints, "n_actuated": world.arm.n_actuated}
        self._space = work_space(**joints, **sizes_of(shapes))
        furnish(shapes.placed, *self._space)
        self.farthest = shapes.farthest
        self.speeds = world.arm.velocity_limits[: self.moved]
        before = np.cumsum(self.speeds) - self.speeds
        bend = (self.farthest * self.speeds * (self.speeds + 2.0 * before)).sum()
        self._longest = LANES * np.sqrt(8.0 * BEND / max(float(bend), 1e-9))

    def durations(self, first: Array, second: Array) -> Array:
        """How long motions between ends, shape (..., n_joints), take at full speed, (...) [s]."""
        moved = np.abs(second - first)[..., : self.moved] / self.speeds
        durations: Array = moved.max(axis=-1)
        return durations

    def lengths(self, first: Array, second: Array) -> Array:
        """Lengths of motions whose joints count by their speeds, shape (...) [s]; see above."""
        moved = (second - first)[..., : self.moved] / self.speeds
        lengths: Array = np.sqrt(np.square(moved).sum(axis=-1))
        return lengths

    def free_share(self, first: Array, second: Array, *, asking: bool = True) -> float:
        """Share of a motion, from its beginning, in which nothing touches; 1 for all of it.

        Kernels prove most parts free, or to touch. Coal is asked about others, or they count as
        contact.
        """
        ends = np.array([first, second])
        part, parts = 0, LANES * max(1, int(np.ceil(self.durations(*ends) / self._longest)))
        while True:
            part = sweep(ends, part, parts, *self._space, self._chain, self._shapes)
            if part < 0 or part == parts or not asking:
                return (-1 - part if part < 0 else part) / parts
            low, high = part / parts, (part + 1) / parts
            step = Step(self.world.contact_model, *ends)
            touching, _ = first_share(step, low, high, margin=self.margin, most=MOST_ASKED)
            if touching is not None:
                return part / parts
            part += 1

    def is_free(self, first: Array, second: Array) -> bool:
        """Whether kernels prove a motion free."""
        return self.free_share(first, second, asking=False) == 1.0


def widened(shapes: ContactShapes, margin: float) -> ContactShapes:
    """Shapes that touch where the given ones come within a margin [m]."""
    if margin == 0.0:
        return shapes
    n_placed = len(shapes.placed)
    names = ("rounding", "capsules", "around", "placed")
    wider = {name: getattr(shapes, name).copy() for name in names}
    of_arm = shapes.bodies[:, 2] <= shapes.bodies[:, 2].max() - n_placed
    wider["rounding"][of_arm] += margin / 2
    wider["capsules"][: len(shapes.around), 6] += margin / 2
    wider["around"][:, 6] += margin / 2
    wider["placed"][:, 3] += margin / 2
    return shapes._replace(**wider)
