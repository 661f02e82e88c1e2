"""Robot descriptions in files: checked trees of links and joints."""

import math
from collections import Counter
from collections.abc import Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from kinarm._files import first_line
from kinarm.errors import ArmError

FARTHEST = 1e4
"""Lengths at most [m]."""

MOVING = ("revolute", "prismatic", "continuous")
"""Kinds of joints that move."""

MOST_SHAPES = 500
"""Collision shapes at most: the pairs of so many take seconds to prepare."""

SHAPES = ("box", "sphere", "cylinder", "capsule", "mesh")

NUMBERS: dict[str, dict[str, tuple[int, str]]] = {
    "origin": {"xyz": (3, "0 0 0"), "rpy": (3, "0 0 0")},
    "axis": {"xyz": (3, "1 0 0")},
    "limit": {"lower": (1, "0"), "upper": (1, "0"), "velocity": (1, "0")},
    "mimic": {"multiplier": (1, "1"), "offset": (1, "0")},
    "box": {"size": (3, "")},
    "sphere": {"radius": (1, "")},
    "cylinder": {"radius": (1, ""), "length": (1, "")},
    "capsule": {"radius": (1, ""), "length": (1, "")},
    "mesh": {"scale": (3, "1 1 1")},
    "color": {"rgba": (4, "0 0 0 1")},
}
"""Attributes with numbers: how many, and their defaults."""

RANGES = {"limit": (-1e308, 1e308)} | dict.fromkeys(SHAPES[:4], (1e-9, FARTHEST))
"""Ranges of these numbers, if not that of lengths."""

NEEDED = {
    "robot": ("link", "joint", "material"),
    "link": ("visual", "collision"),
    "joint": ("origin", "parent", "child", "axis", "limit", "mimic"),
}
"""Elements that are used, by the elements around them."""


class TreeJoint(NamedTuple):
    """A joint of the file."""

    element: Element
    name: str
    kind: str
    parent: str
    child: str

    @property
    def mimics(self) -> str | None:
        """Joint that it mimics."""
        mimic = self.element.find("mimic")
        return None if mimic is None else mimic.get("joint")


def parse_xml(content: bytes) -> Element:
    """Root of an XML document; raises ValueError if it is damaged."""
    try:
        return ElementTree.fromstring(content)
    except (ElementTree.ParseError, LookupError) as error:  # the latter of an unknown encoding
        raise ValueError(str(error)) from error


def read_robot(path: Path) -> Element:
    """Root of a URDF with only the used elements, and numbers as Python writes them.

    Joints get origins and axes. Visual shapes stay unchecked. Raises ArmError if the file is no
    URDF, or the xacro of one, a name or shape is missing, or a number is out of range.
    """
    try:
        robot = parse_xml(path.read_bytes())
    except (OSError, ValueError) as error:
        raise ArmError(f"not a readable URDF: {first_line(error)}") from error
    if robot.tag != "robot":
        raise ArmError(f"not a readable URDF: its root is <{robot.tag}>")
    if any("xacro}" in str(element.tag) for element in robot.iter()):
        raise ArmError(
            "a xacro file, a template of URDFs, which ROS's program makes of it: "
            f"xacro {path.name} > {path.name.partition('.')[0]}.urdf"
        )
    for part in (robot, *robot):
        for element in [each for each in part if each.tag not in NEEDED.get(part.tag, (each.tag,))]:
            part.remove(element)
    shapes = len(robot.findall("link/collision"))
    if shapes > MOST_SHAPES:
        raise ArmError(f"{shapes} collision shapes; at most {MOST_SHAPES} can be tested in pairs")
    for joint in robot.findall("joint"):
        _check_joint(joint, f"joint {joint.get('name')!r}")
    for link in robot.findall("link"):
        check_shapes(link, "collision")
    return robot


def check_shapes(link: Element, use: str) -> None:
    """Check a link's shapes for a use, ``collision`` or ``visual``, and rewrite their numbers.

    Raises ArmError if a shape is missing or unknown, or a number is out of range.
    """
    where = f"link {link.get('name')!r}"
    for element in link.findall(use):
        geometry = element.find("geometry")
        if geometry is None or not len(geometry) or geometry[0].tag not in SHAPES:
            kinds = ", ".join(SHAPES)
            raise ArmError(f"{where} needs a shape of {kinds} in each {use} element")
        geometry[1:] = []
        for part in (geometry[0], *element.findall("origin")):
            check_numbers(part, f"a shape of {where}")


def _check_joint(joint: Element, where: str) -> None:
    """Complete a joint and check its numbers."""
    for name in ("origin", "axis"):
        if joint.find(name) is None:
            ElementTree.SubElement(joint, name)
    for element in joint:
        check_numbers(element, where)
        if element.tag == "limit":
            element.set("effort", "0")
        along = element.get("xyz", "") if element.tag == "axis" else "1"
        if joint.get("type") in MOVING and math.hypot(*map(float, along.split())) < 1e-6:
            raise ArmError(f"{where} has no axis: {element.attrib}")


def check_numbers(element: Element, where: str) -> None:
    """Check and rewrite the numbers of an element, called ``where``.

    Raises ArmError if one is missing, none, too many or out of range.
    """
    least, most = RANGES.get(element.tag, (-FARTHEST, FARTHEST))
    for name, (count, default) in NUMBERS.get(element.tag, {}).items():
        given = element.get(name, default)
        try:
            numbers = [float(word) for word in given.split()]
        except ValueError:
            numbers = []
        if len(numbers) != count or not all(least <= x <= most for x in numbers):
            raise ArmError(
                f"{where}: numbers of {name} of <{element.tag}> must be {count} from {least:g} to "
                f"{most:g}, got {given!r}"
            )
        # Pinocchio refuses numbers that are almost zero.
        element.set(name, " ".join(repr(x if abs(x) > 1e-300 else 0.0) for x in numbers))


def read_joints(robot: Element) -> dict[str, TreeJoint]:
    """Joints by name; raises ArmError unless they form a tree on a fixed base."""
    found: dict[str, TreeJoint] = {}
    links = [link.get("name", "") for link in robot.findall("link")]
    carried: dict[str, str] = {}
    for element in robot.findall("joint"):
        name, kind = element.get("name", ""), element.get("type", "")
        ends = [element.find(end) for end in ("parent", "child")]
        parent, child = ("" if end is None else end.get("link", "") for end in ends)
        for link in (parent, child):
            if link not in links:
                raise ArmError(f"joint {name!r} joins {link!r}, which is no link")
        if child in carried:
            raise ArmError(
                f"link {child!r} hangs on two joints, {carried[child]!r} and {name!r}: "
                "closed loops are not supported"
            )
        if kind not in (*MOVING, "fixed"):
            raise ArmError(
                f"joint {name!r} is {kind}: the base must be fixed, and joints {', '.join(MOVING)} "
                "or fixed"
            )
        carried[child] = name
        found[name] = TreeJoint(element, name, kind, parent, child)
    for what, names in (("joint", list(carried.values())), ("link", links)):
        for name, count in Counter(names).items():
            if not name or count > 1:
                raise ArmError(f"each {what} needs a name of its own, not {name!r}")
    roots = [link for link in links if link not in carried]
    if len(roots) > 1:
        raise ArmError(f"no joint joins the links {', '.join(map(repr, roots))}")
    try:
        TopologicalSorter({joint.child: [joint.parent] for joint in found.values()}).prepare()
    except CycleError:
        raise ArmError("the links form a loop: closed loops are not supported") from None
    return found


def chain_to(link: str, joints: Mapping[str, TreeJoint]) -> list[TreeJoint]:
    """Moving joints from the base to a link."""
    carrier = {joint.child: joint for joint in joints.values()}
    chain: list[TreeJoint] = []
    while link in carrier:
        chain.append(carrier[link])
        link = carrier[link].parent
    return [joint for joint in reversed(chain) if joint.kind in MOVING]
