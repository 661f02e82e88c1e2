"""What people want to know of an arm: joints, shapes, and what may touch what."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import coal
import numpy as np
from numpy.typing import NDArray

from kinarm.arm import Arm
from kinarm.arm_specification import ArmFile
from kinarm.collision import ContactModel
from kinarm.contact_statistics import SAMPLES, ContactStatistics
from kinarm.scene import Scene

BARE_GROUND = Scene(obstacles=(), goal_regions=())


@dataclass(frozen=True, eq=False)
class ArmFacts:
    """An arm on bare ground.

    Attributes
    ----------
    arm : Arm
        The arm.
    contact : ContactModel
        The pairs that are tested.
    """

    arm: Arm
    contact: ContactModel

    @classmethod
    def of(cls, arm: Arm) -> "ArmFacts":
        """Stand an arm on bare ground."""
        return cls(arm, ContactModel.build(arm, BARE_GROUND))

    @cached_property
    def statistics(self) -> ContactStatistics:
        """Contacts at random configurations."""
        return ContactStatistics.sample(self.contact)

    @property
    def speeds(self) -> str:
        """Slowest and fastest joint that is actuated."""
        return span(self.arm.velocity_limits[: self.arm.n_actuated], bool(self._prismatic.any()))

    @property
    def _prismatic(self) -> NDArray[np.bool_]:
        return self.arm.chain.prismatic

    def left_out(self) -> Iterator[tuple[str, str, str]]:
        """Pairs of bodies that are not tested, and why."""
        shapes = list(zip(self.arm.geometry.geometryObjects, self.contact.body_names, strict=False))
        allowed = {frozenset(each.links): each.reason for each in self.arm.allowed_contacts}
        for (first, one), (second, other) in combinations(shapes, 2):
            links = frozenset(shape.name.rsplit("_", 1)[0] for shape in (first, second))
            if abs(first.parentJoint - second.parentJoint) == 1:
                yield one, other, "neighbours"
            elif first.parentJoint != second.parentJoint and links in allowed:
                yield one, other, f"allowed: {allowed[links]}"
        for (one, other), reason in self.contact.left_out.items():
            yield one, other, reason

    def sections(self) -> dict[str, list[str]]:
        """All of it, as lines under headings."""
        arm, statistics = self.arm, self.statistics
        file = ArmFile.of(arm.specification.source)
        tool = ", ".join(f"{number:.4g}" for number in arm.tool_position(arm.home))
        about = [] if file is None else [file.title, file.licence, file.origin, file.notes]
        return {
            arm.name: [line for line in (*about, *arm.description.notes) if line],
            "joints": list(map(self._joint, range(arm.n_joints))),
            "held": [f"{name} at {position:g}" for name, position in arm.description.held.items()],
            "tool": [f"{arm.tool_frame}, at home at ({tool}) m; reach at most {arm.reach:.2f} m"],
            "collision shapes": list(map(self._shape, range(arm.geometry.ngeoms))),
            f"pairs that are tested ({len(statistics.pairs)}), and how often they touch": [
                f"{' and '.join(pair)}: {_frequency(share)}"
                for pair, share in statistics.shares.items()
            ],
            "pairs that are left out": [
                f"{one} and {other}: {reason}" for one, other, reason in self.left_out()
            ],
        }

    def _joint(self, index: int) -> str:
        """Limits and speed of a joint."""
        arm, prismatic = self.arm, bool(self._prismatic[index])
        limits = np.array([arm.lower[index], arm.upper[index]])
        use = "" if index < arm.n_actuated else "; not actuated, stays at home"
        speed = span(arm.velocity_limits[index : index + 1], prismatic)
        unit = "m" if prismatic else "deg"
        ends = " to ".join(f"{end:g}" for end in _shown(limits, prismatic))
        return f"{arm.joint_names[index]}: {ends} {unit}, {speed} {unit}/s{use}"

    def _shape(self, index: int) -> str:
        """Kind of a collision shape."""
        shape = self.arm.geometry.geometryObjects[index]
        kind = type(shape.geometry).__name__.lower()
        if isinstance(shape.geometry, coal.ConvexBase):
            kind = f"convex hull of {shape.geometry.num_points} vertices"
        return f"{self.contact.body_names[index]}: {kind}"


def span(values: NDArray[np.float64], prismatic: bool) -> str:
    """The range of some positions or speeds; angles in degrees."""
    ends = dict.fromkeys(f"{value:g}" for value in _shown(np.sort(values)[[0, -1]], prismatic))
    return " to ".join(ends)


def _shown(values: NDArray[np.float64], prismatic: bool) -> list[float]:
    """Numbers that people read: degrees, or metres."""
    rounded = np.round(values if prismatic else np.rad2deg(values), 2 if prismatic else 0)
    return [float(value) for value in rounded]


def _frequency(share: float) -> str:
    """How often a pair touches."""
    often = {0.0: "at none", 1.0: "at all"}.get(share, f"at {share:.1%}")
    return f"{often} of {SAMPLES} random configurations"
