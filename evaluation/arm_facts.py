"""Facts of an arm: joints, shapes, and what may touch what."""

from collections.abc import Iterator
from itertools import combinations

import coal
import numpy as np
from numpy.typing import NDArray

from kinarm.arm import Arm
from kinarm.arm_specification import ArmFile
from kinarm.clearance import SAMPLES, ContactStatistics, arm_warnings, contact_on_bare_ground
from kinarm.collision import ContactModel
from kinarm.contact_pairs import are_neighbours, link_of
from kinarm.evaluation.report.templating import template_environment
from kinarm.evaluation.self_contact import SelfContact


def joint_speeds(arm: Arm) -> str:
    """Slowest and fastest actuated joint [deg/s, or m/s]."""
    speeds = arm.velocity_limits[: arm.n_actuated]
    return _span(np.sort(speeds)[[0, -1]], bool(arm.chain.prismatic.any()))


def untested_pairs(contact: ContactModel) -> Iterator[tuple[str, str, str]]:
    """Pairs of links, then of bodies, that are not tested, and why."""
    reasons: dict[tuple[str, str], str] = {}
    allowed = {frozenset(each.links): each.reason for each in contact.arm.allowed_contacts}
    for first, second in combinations(contact.arm.geometry.geometryObjects, 2):
        pair = link_of(first), link_of(second)
        if are_neighbours(contact.arm, first, second):
            reasons[pair] = "neighbours"
        elif first.parentJoint != second.parentJoint and frozenset(pair) in allowed:
            reasons[pair] = f"allowed: {allowed[frozenset(pair)]}"
    for (one, other), reason in (reasons | contact.left_out).items():
        yield one, other, reason


def arm_facts(arm: Arm) -> str:
    """All facts, as lines under headings."""
    contact, file = contact_on_bare_ground(arm), ArmFile.of(arm.specification.source)
    shapes = (_shape(each.geometry) for each in arm.geometry.geometryObjects)
    inflated = SelfContact(contact).warning()
    environment = template_environment()
    environment.filters["span"] = _span
    text = environment.get_template("arm.txt").render(
        arm=arm,
        about=[] if file is None else [file.title, file.licence, file.origin, file.notes],
        shapes=zip(contact.body_names, shapes, strict=False),
        statistics=ContactStatistics.sample(contact),
        untested=untested_pairs(contact),
        warnings=[*arm_warnings(contact), *([inflated] if inflated else [])],
        samples=SAMPLES,
    )
    return text.rstrip()


def _shape(shape: coal.CollisionGeometry) -> str:
    """Kind of a collision shape."""
    if isinstance(shape, coal.ConvexBase):
        return f"convex hull of {shape.num_points} vertices"
    return type(shape).__name__.lower()


def _span(values: NDArray[np.float64] | list[float], prismatic: bool) -> str:
    """Positions or speeds as text, in metres or degrees; equal ones once."""
    numbers = np.asarray(values, dtype=np.float64)
    shown = np.round(numbers, 2) if prismatic else np.round(np.rad2deg(numbers))
    return " to ".join(dict.fromkeys(f"{value:g}" for value in shown))
