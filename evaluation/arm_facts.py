"""Facts of an arm: joints, shapes, and what may touch what."""

from collections.abc import Iterator
from itertools import combinations

import coal
import numpy as np
from numpy.typing import NDArray

from kinarm.arm import Arm
from kinarm.arm_specification import ArmFile
from kinarm.clearance import SAMPLES, ContactStatistics
from kinarm.collision import ContactModel
from kinarm.scene import Scene


def contact_on_bare_ground(arm: Arm) -> ContactModel:
    """The pairs of bodies that are tested for contact where nothing stands but the arm."""
    return ContactModel.build(arm, Scene(obstacles=(), goal_regions=()))


def joint_speeds(arm: Arm) -> str:
    """Slowest and fastest joint that is actuated [deg/s, or m/s]."""
    speeds = arm.velocity_limits[: arm.n_actuated]
    return _span(np.sort(speeds)[[0, -1]], bool(arm.chain.prismatic.any()))


def untested_pairs(contact: ContactModel) -> Iterator[tuple[str, str, str]]:
    """Pairs of bodies that are not tested, and why."""
    shapes = list(zip(contact.arm.geometry.geometryObjects, contact.body_names, strict=False))
    allowed = {frozenset(each.links): each.reason for each in contact.arm.allowed_contacts}
    for (first, one), (second, other) in combinations(shapes, 2):
        links = frozenset(shape.name.rsplit("_", 1)[0] for shape in (first, second))
        if abs(first.parentJoint - second.parentJoint) == 1:
            yield one, other, "neighbours"
        elif first.parentJoint != second.parentJoint and links in allowed:
            yield one, other, f"allowed: {allowed[links]}"
    for (one, other), reason in contact.left_out.items():
        yield one, other, reason


def arm_facts(arm: Arm) -> dict[str, list[str]]:
    """All of it, as lines under headings."""
    contact = contact_on_bare_ground(arm)
    statistics = ContactStatistics.sample(contact)
    file = ArmFile.of(arm.specification.source)
    tool = ", ".join(f"{number:.4g}" for number in arm.tool_position(arm.home))
    about = [] if file is None else [file.title, file.licence, file.origin, file.notes]
    shapes = zip(contact.body_names, arm.geometry.geometryObjects, strict=False)
    return {
        arm.name: [line for line in (*about, *arm.description.notes) if line],
        "joints": [_joint(arm, index) for index in range(arm.n_joints)],
        "held": [f"{name} at {position:g}" for name, position in arm.description.held.items()],
        "tool": [f"{arm.tool_frame}, at home at ({tool}) m; reach at most {arm.reach:.2f} m"],
        "collision shapes": [f"{body}: {_shape(each.geometry)}" for body, each in shapes],
        f"pairs that are tested ({len(statistics.pairs)}), and how often they touch": [
            f"{' and '.join(pair)}: {_frequency(share)}"
            for pair, share in statistics.shares.items()
        ],
        "pairs that are left out": [
            f"{one} and {other}: {reason}" for one, other, reason in untested_pairs(contact)
        ],
    }


def _joint(arm: Arm, index: int) -> str:
    """Limits and speed of a joint."""
    prismatic = bool(arm.chain.prismatic[index])
    unit = "m" if prismatic else "deg"
    limits = _span(np.array([arm.lower[index], arm.upper[index]]), prismatic)
    speed = _span(arm.velocity_limits[index : index + 1], prismatic)
    use = "" if index < arm.n_actuated else "; not actuated, stays at home"
    return f"{arm.joint_names[index]}: {limits} {unit}, {speed} {unit}/s{use}"


def _shape(shape: coal.CollisionGeometry) -> str:
    """Kind of a collision shape."""
    if isinstance(shape, coal.ConvexBase):
        return f"convex hull of {shape.num_points} vertices"
    return type(shape).__name__.lower()


def _span(values: NDArray[np.float64], prismatic: bool) -> str:
    """Positions or speeds as people read them: metres, or degrees; equal ones once."""
    shown = np.round(values, 2) if prismatic else np.round(np.rad2deg(values))
    return " to ".join(dict.fromkeys(f"{value:g}" for value in shown))


def _frequency(share: float) -> str:
    """How often a pair touches."""
    often = {0.0: "at none", 1.0: "at all"}.get(share, f"at {share:.1%}")
    return f"{often} of {SAMPLES} random configurations"
