"""Facts of an arm: joints, shapes, what may touch what, and how often it touches itself."""

from collections.abc import Collection, Iterator
from itertools import combinations

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kinarm.arm import Arm
from kinarm.arm_specification import MOST_PIECES, ArmFile
from kinarm.collision import ContactModel
from kinarm.contact_pairs import (
    TOUCH_AT_HOME,
    are_neighbours,
    link_of,
    make_verdicts_reliable,
    random_configurations,
)
from kinarm.contact_statistics import (
    SAMPLES,
    ContactStatistics,
    arm_warnings,
    contact_on_bare_ground,
)
from kinarm.evaluation.report.templating import template


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
    text = template("arm.txt").render(
        arm=arm,
        about=[] if file is None else [file.title, file.licence, file.origin, file.notes],
        shapes=zip(contact.body_names, shapes, strict=False),
        statistics=ContactStatistics.sample(contact),
        untested=untested_pairs(contact),
        warnings=[*arm_warnings(contact), *([inflated] if inflated else [])],
        samples=SAMPLES,
        span=_span,
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


MUCH, SOME = 0.02, 0.01
"""Shares of configurations that touch by hulls alone: to be warned of, and to name a link for."""

FIRST_PIECES = 4
"""Pieces that are proposed for meshes that are not cut yet."""


class SelfContact:
    """Which random configurations touch, with hulls and with meshes; see `kinarm.contact_pairs`.

    Links are tested that are tested in simulations, but those of which shapes touch at home. A mesh
    is a surface: nothing touches it from inside. Verdicts, shape (n,), are with the arm's shapes,
    ``simulated``, and with the ``meshes`` of its URDF.
    """

    def __init__(self, contact: ContactModel, count: int = SAMPLES) -> None:
        self._arm, self._configurations = contact.arm, random_configurations(contact.arm, count)
        shapes = list(contact.arm.geometry.geometryObjects)
        links = dict(zip(contact.body_names, map(link_of, shapes), strict=False))
        resting = [pair for pair, why in contact.left_out.items() if why == TOUCH_AT_HOME]
        tested, untested = (
            {frozenset(links[name] for name in pair) for pair in pairs if links.keys() >= {*pair}}
            for pairs in (contact.pair_names, resting)
        )
        self._links, self._pairs = sorted(set(links.values())), tested - untested
        self.simulated, self.meshes = self._touching(self._links), self._touching(())

    def _touching(self, simulated: Collection[str]) -> NDArray[np.bool_]:
        """Which configurations touch, where some links have their shapes, the others meshes."""
        arm, geometry = self._arm, pin.GeometryModel()
        for model in (arm.geometry, arm.meshes):
            for shape in model.geometryObjects:
                if (link_of(shape) in simulated) == (model is arm.geometry):
                    geometry.addGeometryObject(shape)
        links = [link_of(shape) for shape in geometry.geometryObjects]
        for first, second in combinations(range(len(links)), 2):
            if {links[first], links[second]} in self._pairs:
                geometry.addCollisionPair(pin.CollisionPair(first, second))
        data, placed = arm.model.createData(), make_verdicts_reliable(geometry.createData())
        return np.array(
            [
                pin.computeCollisions(arm.model, data, geometry, placed, q, True)
                for q in self._configurations
            ]
        )

    def warning(self) -> str | None:
        """Say in a line if the shapes touch much more often, and which meshes to cut."""
        often, meshes = self.simulated.mean(), self.meshes.mean()
        if often - meshes <= MUCH:
            return None
        pieces = self._arm.specification.completed().pieces or {}
        added = {link: self._touching((link,)).mean() - meshes for link in self._links}
        wanted = {
            link: min(2 * pieces.get(link, FIRST_PIECES // 2), MOST_PIECES)
            for link, share in added.items()
            if share >= min(SOME, max(added.values()))
        }
        listed = ", ".join(f"{link} = {count}" for link, count in wanted.items())
        return (
            f"touches itself at {often:.1%} of random configurations, with its meshes as they are "
            f"at {meshes:.1%}; an arm file can cut meshes into convex pieces: "
            f"pieces = {{ {listed} }}"
        )
