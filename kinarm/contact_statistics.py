"""Frequencies of contact at random, and warnings."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kinarm.arm import Arm
from kinarm.arm_specification import arm_names
from kinarm.collision import ContactModel
from kinarm.contact_pairs import TOUCH_AT_HOME, make_verdicts_reliable, random_configurations
from kinarm.errors import ProblemError
from kinarm.kernels.compiling import Array
from kinarm.scene import Scene

SAMPLES = 2000


@dataclass(frozen=True, eq=False)
class ContactStatistics:
    """Which pairs touch at random configurations within the limits.

    Attributes
    ----------
    pairs : tuple
        Names of the two bodies of each tested pair.
    touching : ndarray of bool, shape (n_samples, n_pairs)
        Whether they touch.
    """

    pairs: tuple[tuple[str, str], ...]
    touching: NDArray[np.bool_]

    @classmethod
    def sample(
        cls, model: ContactModel, count: int = SAMPLES, scenes: Sequence[Array] = ()
    ) -> "ContactStatistics":
        """Ask Coal for every pair, at random configurations, each in a scene if there are some.

        Scenes have the shape (count, n_placed, 16).
        """
        q, asked = random_configurations(model.arm, count), model.at(scenes[0]) if scenes else model
        data = asked.arm.model.createData()
        geometry_data = make_verdicts_reliable(asked.geometry.createData())
        results = list(geometry_data.collisionResults)
        touching = np.zeros((count, len(results)), dtype=bool)
        for number, (row, configuration) in enumerate(zip(touching, q, strict=True)):
            if scenes:
                model.at(scenes[number])
            pin.computeCollisions(
                asked.arm.model, data, asked.geometry, geometry_data, configuration, False
            )
            row[:] = [result.isCollision() for result in results]
        return cls(model.pair_names, touching)

    @property
    def free(self) -> NDArray[np.bool_]:
        """Configurations without contact, shape (n_samples,)."""
        return np.logical_not(self.touching.any(axis=1))

    @property
    def shares(self) -> dict[tuple[str, str], float]:
        """Share of configurations at which pairs touch, largest first."""
        shares = self.touching.mean(axis=0)
        order = np.argsort(-shares, kind="stable")
        return {self.pairs[index]: float(shares[index]) for index in order}

    def check_movable(self, arm: str) -> None:
        """Refuse a world that is always in contact."""
        if not self.free.any():
            (pair, share), *_ = self.shares.items()
            raise ProblemError(
                f"arm {arm!r} cannot move: it touches something at all of {len(self.free)} random "
                f"configurations, {' and '.join(pair)} at {share:.0%} of them"
            )


FASTEST = 30.0
"""Joint speed beyond which a velocity limit is doubtful [rad/s]."""


def contact_on_bare_ground(arm: Arm) -> ContactModel:
    """The pairs of bodies tested for contact where only the arm stands."""
    return ContactModel.build(arm, Scene(obstacles=(), goal_regions=()))


def arm_warnings(contact: ContactModel) -> list[str]:
    """What makes the description of an arm doubtful, a line each.

    These are missing collision shapes, pairs of bodies that are never tested,
    since they touch at home (of shipped arms, pairs with a held body), and
    joints faster than 30 rad/s. Takes an arm's `contact_on_bare_ground`.
    """
    arm, lines = contact.arm, list[str]()
    held = {body.name for body in arm.held_bodies}
    own = arm.specification.source not in arm_names()
    if not any(shape.parentJoint for shape in arm.geometry.geometryObjects):
        lines.append("no moving link has a collision shape: it touches nothing, ever")
    untested = (pair for pair, why in contact.left_out.items() if why == TOUCH_AT_HOME)
    resting = [" and ".join(pair) for pair in untested if own or held & set(pair)]
    if resting:
        more = f", and {len(resting) - 3} more" if len(resting) > 3 else ""
        lines.append(
            "never tested for contact, since they touch at home: "
            f"{', '.join(resting[:3])}{more}; an arm file can name another home, or say that this "
            "is meant (allowed_contacts)"
        )
    fast = [
        f"{name} {speed:.0f} rad/s"
        for name, speed, slides in zip(
            arm.joint_names, arm.velocity_limits, arm.chain.prismatic, strict=True
        )
        if speed > FASTEST and not slides
    ]
    if fast:
        lines.append(f"velocity limits that no arm reaches: {', '.join(fast)}")
    return lines
