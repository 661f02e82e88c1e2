"""Robot descriptions as their files have them: a tree of links and joints, checked."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from kinarm._files import first_line, read_file
from kinarm.errors import ArmError

LARGEST = 5 * 10**6
"""Size of a URDF at most [bytes]."""

MOST_LINKS = 500
"""Links of a robot at most."""

FARTHEST = 1e4
"""Lengths at most [m]."""

FARTHEST_POSITION = 1e6
"""Positions of joints at most [rad or m]: up to there, the kernels' sines are exact."""

ANY = 1e308
"""Limits of joints at most, which need not be used."""

MOVING = ("revolute", "prismatic", "continuous")
"""Kinds of joints that move."""

SHAPES = ("box", "sphere", "cylinder", "capsule", "mesh")


class Rule(NamedTuple):
    """An attribute that holds numbers.

    Attributes
    ----------
    n : int
        How many.
    default : str or None
        What it is where it is left out; None if it must be there.
    least, most : float
        Range of each.
    """

    n: int
    default: str | None
    least: float = -FARTHEST
    most: float = FARTHEST


SIZE = Rule(1, None, least=1e-9)

RULES: dict[str, dict[str, Rule]] = {
    "origin": {"xyz": Rule(3, "0 0 0"), "rpy": Rule(3, "0 0 0")},
    "axis": {"xyz": Rule(3, "1 0 0")},
    "limit": {
        "lower": Rule(1, "0", least=-ANY, most=ANY),
        "upper": Rule(1, "0", least=-ANY, most=ANY),
        "velocity": Rule(1, "0", least=0.0, most=ANY),
    },
    "mimic": {"multiplier": Rule(1, "1"), "offset": Rule(1, "0")},
    "box": {"size": SIZE._replace(n=3)},
    "sphere": {"radius": SIZE},
    "cylinder": {"radius": SIZE, "length": SIZE},
    "capsule": {"radius": SIZE, "length": SIZE},
    "mesh": {"scale": Rule(3, "1 1 1")},
    "color": {"rgba": Rule(4, "0 0 0 1")},
}
"""Attributes of elements that hold numbers."""

NEEDED = {
    "robot": ("link", "joint", "material"),
    "link": ("visual", "collision"),
    "joint": ("origin", "parent", "child", "axis", "limit", "mimic"),
}
"""Elements that count for something, by those around them."""


class TreeJoint(NamedTuple):
    """A joint of the file."""

    element: Element
    name: str
    kind: str
    parent: str
    child: str

    @property
    def mimics(self) -> str | None:
        """The joint that it mimics."""
        mimic = self.element.find("mimic")
        return None if mimic is None else mimic.get("joint")


def parse_xml(content: bytes) -> Element:
    """The root of an XML document.

    Raises
    ------
    ValueError
        If it is damaged.
    """
    try:
        return ElementTree.fromstring(content)
    except (ElementTree.ParseError, LookupError) as error:  # the latter of an unknown encoding
        raise ValueError(str(error)) from error


def read_robot(path: Path) -> Element:
    """The root of a URDF, without what nobody needs; its numbers are written as Python does.

    Visual shapes stay as they are: who draws them checks them.

    Raises
    ------
    ArmError
        If the file is none, a name or a shape is missing, or a number is none, too many or out of
        range.
    """
    try:
        robot = parse_xml(read_file(path, LARGEST))
    except (OSError, ValueError) as error:
        raise ArmError(f"{path.name} is not a readable URDF: {first_line(error)}") from error
    if robot.tag != "robot":
        raise ArmError(
            f"{path.name} is not a readable URDF: its root is <{robot.tag}>, not <robot>"
        )
    capsules = robot.find("link/collision/geometry/capsule") is not None
    if capsules and robot.get("version", "1.0") not in ("1.1", "1.2"):
        raise ArmError(f'{path.name} has capsules, which need <robot version="1.2">')
    for part in (robot, *robot):
        for element in [each for each in part if each.tag not in NEEDED.get(part.tag, (each.tag,))]:
            part.remove(element)
    for joint in robot.findall("joint"):
        _check_joint(joint, path.name)
    _check_links(robot.findall("link"), path.name)
    return robot


def _check_joint(joint: Element, file: str) -> None:
    """Check name and numbers of a joint."""
    name = joint.get("name")
    if not name:
        raise ArmError(f"{file} is not a readable URDF: a joint has no name")
    if (limit := joint.find("limit")) is not None:
        limit.set("effort", "0")
    for element in joint:
        check_numbers(element, f"joint {name!r} of {file}")
    axis = None if joint.get("type") == "fixed" else joint.find("axis")
    if axis is not None and math.hypot(*map(float, axis.attrib["xyz"].split())) < 1e-6:
        raise ArmError(f"joint {name!r} of {file} has no axis: {axis.attrib}")


def _check_links(links: list[Element], file: str) -> None:
    """Check names and collision shapes of all links."""
    names = [link.get("name", "") for link in links]
    if len(links) > MOST_LINKS:
        raise ArmError(f"{file} has {len(links)} links: more than {MOST_LINKS}")
    for name, link in zip(names, links, strict=True):
        if not name or names.count(name) > 1:
            what = f"two links are called {name!r}" if name else "a link has no name"
            raise ArmError(f"{file} is not a readable URDF: {what}")
        for collision in link.findall("collision"):
            for element in _shape_and_origin(collision, f"link {name!r} of {file}"):
                check_numbers(element, f"a shape of link {name!r} of {file}")


def _shape_and_origin(collision: Element, where: str) -> Iterator[Element]:
    """The shape of a collision element, the first if it has several, and its origin."""
    geometry = collision.find("geometry")
    shape = None if geometry is None else next(iter(geometry), None)
    if geometry is None or shape is None or shape.tag not in SHAPES:
        found = "none" if shape is None else f"<{shape.tag[:40]}>"
        raise ArmError(f"{where} needs a shape of {', '.join(SHAPES)}, got {found}")
    geometry[1:] = []
    yield shape
    yield from collision.findall("origin")


def check_numbers(element: Element, where: str) -> None:
    """Check the numbers of an element, called ``where``, and rewrite them.

    Raises
    ------
    ArmError
        If one is missing, none, too many or out of range.
    """
    for name, rule in RULES.get(element.tag, {}).items():
        given = element.get(name, rule.default)
        if given is None:
            raise ArmError(f"{where}: <{element.tag}> lacks {name}")
        try:
            numbers = [float(word) for word in given.split()]
        except ValueError:
            numbers = []
        if len(numbers) != rule.n or not all(rule.least <= x <= rule.most for x in numbers):
            wanted = f"{rule.n} from {rule.least:g} to {rule.most:g}"
            raise ArmError(
                f"{where}: numbers of {name} of <{element.tag}> must be {wanted}, got {given!r}"
            )
        # Pinocchio's reader refuses numbers that are almost zero.
        element.set(name, " ".join(repr(x if abs(x) > 1e-300 else 0.0) for x in numbers))


def read_joints(robot: Element, path: Path) -> dict[str, TreeJoint]:
    """Joints by name.

    Raises
    ------
    ArmError
        If they and the links are no tree on a fixed base.
    """
    found: dict[str, TreeJoint] = {}
    links = {link.get("name", "") for link in robot.findall("link")}
    carried: dict[str, str] = {}
    for element in robot.findall("joint"):
        name, kind = element.get("name", ""), element.get("type", "")
        ends = [element.find(end) for end in ("parent", "child")]
        parent, child = ("" if end is None else end.get("link", "") for end in ends)
        for link in (parent, child):
            if link not in links:
                raise ArmError(
                    f"{path.name} is not a readable URDF: joint {name!r} joins {link!r}, which is "
                    "no link"
                )
        if name in found:
            raise ArmError(f"{path.name} is not a readable URDF: two joints are called {name!r}")
        if child in carried:
            raise ArmError(
                f"link {child!r} of {path.name} hangs on two joints, {carried[child]!r} and "
                f"{name!r}: closed loops are not supported"
            )
        if kind in ("floating", "planar"):
            raise ArmError(f"joint {name!r} of {path.name} is {kind}: the base must be fixed")
        if kind not in (*MOVING, "fixed"):
            raise ArmError(f"joint {name!r} of {path.name} is {kind!r}: not supported")
        carried[child] = name
        found[name] = TreeJoint(element, name, kind, parent, child)
    _check_tree(found, links, path)
    return found


def _check_tree(joints: Mapping[str, TreeJoint], links: set[str], path: Path) -> None:
    """Refuse links that do not hang on one link, the base."""
    carried = {joint.child for joint in joints.values()}
    roots = [link for link in links if link not in carried]
    if len(roots) > 1:
        names = ", ".join(sorted(map(repr, roots)))
        raise ArmError(f"{path.name} has links that no joint joins: {names}")
    below, reached = {joint.child: joint.parent for joint in joints.values()}, set(roots)
    for _ in joints:
        reached |= {child for child, parent in below.items() if parent in reached}
    if reached != links:
        raise ArmError(f"the links of {path.name} form a loop: closed loops are not supported")


def chain_to(link: str, joints: Mapping[str, TreeJoint]) -> list[TreeJoint]:
    """Moving joints between the base and a link, in that order."""
    carrier = {joint.child: joint for joint in joints.values()}
    chain: list[TreeJoint] = []
    while link in carrier:
        chain.append(carrier[link])
        link = carrier[link].parent
    return [joint for joint in reversed(chain) if joint.kind in MOVING]
