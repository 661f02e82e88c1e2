"""The tree of joints that a robot description is: links, each carried by a joint at most."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from kinarm.errors import ArmError

MOVING = ("revolute", "prismatic", "continuous")
"""Kinds of joints that move."""


class TreeJoint(NamedTuple):
    """A joint of the file."""

    element: ElementTree.Element
    name: str
    kind: str
    parent: str
    child: str

    @property
    def mimics(self) -> str | None:
        """The joint that it mimics."""
        mimic = self.element.find("mimic")
        return None if mimic is None else mimic.get("joint")


def read_joints(robot: ElementTree.Element, path: Path) -> dict[str, TreeJoint]:
    """Joints by name; refuses what is no tree on a fixed base."""
    found: dict[str, TreeJoint] = {}
    links = {link.get("name") for link in robot.findall("link")}
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


def _check_tree(joints: Mapping[str, TreeJoint], links: set[str | None], path: Path) -> None:
    """Refuse links that do not hang on one link, the base."""
    carried = {joint.child: joint.parent for joint in joints.values()}
    roots = [link for link in links if link not in carried]
    if links and not roots:
        raise ArmError(f"the links of {path.name} form a loop: closed loops are not supported")
    if len(roots) > 1:
        names = ", ".join(sorted(map(repr, roots)))
        raise ArmError(f"{path.name} has links that no joint joins: {names}")
    for link in carried:
        passed: set[str] = set()
        while link in carried and link not in passed:
            passed.add(link)
            link = carried[link]
        if link in passed:
            raise ArmError(f"the links of {path.name} form a loop: closed loops are not supported")


def chain_to(link: str, joints: Mapping[str, TreeJoint]) -> list[TreeJoint]:
    """Moving joints between the base and a link, in that order."""
    carrier = {joint.child: joint for joint in joints.values()}
    chain: list[TreeJoint] = []
    while link in carrier and len(chain) <= len(joints):
        joint = carrier[link]
        chain.append(joint)
        link = joint.parent
    return [joint for joint in reversed(chain) if joint.kind in MOVING]
