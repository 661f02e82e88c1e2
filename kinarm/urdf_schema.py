"""What a URDF may say: its numbers are checked and rewritten, and what nobody needs is left out."""

import math
import sys
from collections.abc import Iterator
from typing import NamedTuple
from xml.etree.ElementTree import Element

from kinarm.errors import ArmError

MOST_LINKS = 500
"""Links of a robot at most."""

FARTHEST = 1e4
"""Lengths at most [m]."""

FARTHEST_POSITION = 1e6
"""Positions of joints at most [rad or m]: up to there, the kernels' sines are exact."""

Numbers = tuple[float, ...]


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
ANY = {"least": -sys.float_info.max, "most": sys.float_info.max}

RULES: dict[str, dict[str, Rule]] = {
    "origin": {"xyz": Rule(3, "0 0 0"), "rpy": Rule(3, "0 0 0")},
    "axis": {"xyz": Rule(3, "1 0 0")},
    "limit": {
        "lower": Rule(1, "0", **ANY),
        "upper": Rule(1, "0", **ANY),
        "velocity": Rule(1, "0", least=0.0, most=sys.float_info.max),
    },
    "mimic": {"multiplier": Rule(1, "1"), "offset": Rule(1, "0")},
    "box": {"size": Rule(3, None, least=1e-9)},
    "sphere": {"radius": SIZE},
    "cylinder": {"radius": SIZE, "length": SIZE},
    "capsule": {"radius": SIZE, "length": SIZE},
    "mesh": {"scale": Rule(3, "1 1 1")},
}
"""Attributes of elements that hold numbers."""

SHAPES = ("box", "sphere", "cylinder", "capsule", "mesh")

NEEDED = {
    "robot": ("link", "joint", "material"),
    "link": ("visual", "collision"),
    "joint": ("origin", "parent", "child", "axis", "limit", "mimic"),
}
"""Elements that count for something, by those around them."""


def apply_schema(robot: Element, file: str) -> None:
    """Check a robot's links, joints and collision shapes; write their numbers as Python does.

    Visual shapes stay as they are: who draws them checks them.

    Raises
    ------
    ArmError
        If a name or a shape is missing, or a number is none, too many or out of range.
    """
    for part in (robot, *robot):
        for element in [each for each in part if each.tag not in NEEDED.get(part.tag, (each.tag,))]:
            part.remove(element)
    links = robot.findall("link")
    names = [link.get("name", "") for link in links]
    if len(links) > MOST_LINKS:
        raise ArmError(f"{file} has {len(links)} links: more than {MOST_LINKS}")
    for name in names:
        if not name or names.count(name) > 1:
            what = f"two links are called {name!r}" if name else "a link has no name"
            raise ArmError(f"{file} is not a readable URDF: {what}")
    for joint in robot.findall("joint"):
        if not joint.get("name"):
            raise ArmError(f"{file} is not a readable URDF: a joint has no name")
        if (limit := joint.find("limit")) is not None:
            limit.set("effort", "0")
        for element in joint:
            check_numbers(element, f"joint {joint.get('name')!r} of {file}")
        axis = joint.find("axis")
        if axis is not None and joint.get("type") != "fixed":
            length = math.hypot(*map(float, axis.attrib["xyz"].split()))
            if length < 1e-6:
                raise ArmError(f"joint {joint.get('name')!r} of {file} has no axis: {axis.attrib}")
    for link in links:
        for collision in link.findall("collision"):
            for element in _parts(collision, f"link {link.get('name')!r} of {file}"):
                check_numbers(element, f"a shape of link {link.get('name')!r} of {file}")


def _parts(collision: Element, where: str) -> Iterator[Element]:
    """Origin and shape of a collision element."""
    yield from collision.findall("origin")
    geometry = collision.find("geometry")
    shape = None if geometry is None else next(iter(geometry), None)
    if geometry is None or shape is None or shape.tag not in SHAPES:
        found = "none" if shape is None else f"<{shape.tag[:40]}>"
        raise ArmError(f"{where} needs a shape of {', '.join(SHAPES)}, got {found}")
    for other in [each for each in geometry if each is not shape]:
        geometry.remove(other)
    yield shape


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
        numbers = _numbers(given)
        if len(numbers) != rule.n or not all(rule.least <= x <= rule.most for x in numbers):
            least, most = max(rule.least, -FARTHEST), min(rule.most, FARTHEST)
            wanted = f"{rule.n} from {least:g} to {most:g}"
            if rule.most > FARTHEST:
                wanted = f"{rule.n} of {'any size' if rule.least < 0 else 'at least 0'}"
            raise ArmError(
                f"{where}: numbers of {name} of <{element.tag}> must be {wanted}, got {given!r}"
            )
        # Pinocchio's reader refuses numbers that are almost zero.
        element.set(name, " ".join(repr(x if abs(x) > 1e-300 else 0.0) for x in numbers))


def _numbers(text: str) -> Numbers:
    """Numbers of an attribute; NaN, which is in no range, for a word that is none."""
    found = []
    for word in text.split():
        try:
            found.append(float(word))
        except ValueError:
            found.append(math.nan)
    return tuple(found)
