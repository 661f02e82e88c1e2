"""Robot descriptions: a URDF reduced to an arm, as text for Pinocchio.

Joints between base and tool are kept. Others, and held ones with all that mimic them, become fixed.
Continuous joints get a range, and mesh names become paths.
"""

import math
from collections.abc import Collection, Mapping
from importlib import metadata
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kinarm._files import absolute, is_file, is_folder
from kinarm.arm_specification import PACKAGE, ArmSpecification, arm_names
from kinarm.errors import ArmError, UnknownNameError, check_known
from kinarm.meshes import resolve_meshes
from kinarm.urdf_tree import MOVING, TreeJoint, chain_to, read_joints, read_robot

USUAL_TOOL = "tool0"
"""The tool frame's name by ROS's convention."""

FARTHEST_POSITION = 1e4
"""Largest positions of joints [rad or m]: kernels' sums stay within a nanometre up to there."""


class Description(NamedTuple):
    """A URDF made ready for an arm.

    Attributes
    ----------
    path : Path
        The file.
    text : str
        Its text, with all moving joints in series from the base to the tool.
    tool_frame : str
        Link whose origin is the tool point.
    held : dict
        Positions at which joints were fixed, by name [rad or m].
    notes : tuple of str
        Choices where nothing was said.
    """

    path: Path
    text: str
    tool_frame: str
    held: dict[str, float]
    notes: tuple[str, ...]


def _find_urdf(source: str) -> Path:
    """File of a completed specification."""
    if source.startswith(PACKAGE):
        return _installed(source)
    path = Path(source)
    if is_file(path):
        return absolute(path)
    if is_folder(path):
        raise ArmError(f"{source!r} is a folder, not a URDF")
    if path.suffix == ".urdf" or path.parent != Path():
        raise ArmError(f"URDF {source!r} does not exist")
    raise UnknownNameError("arm", source, (*arm_names(), "path/to/robot.urdf", "path/to/arm.toml"))


def _installed(source: str) -> Path:
    """File of the installed package of robot descriptions."""
    name, _, inside = source.partition(":")
    try:
        package = metadata.distribution(name)
    except metadata.PackageNotFoundError:
        raise ArmError(
            f"{Path(inside).name} is part of the package {name}: pip install 'kinarm[robots]'"
        ) from None
    share = Path(str(package.locate_file(f"cmeel.prefix/share/{name}/robots")))
    if not (share / inside).is_file():
        raise ArmError(f"the package {name} {package.version} has no {inside}: another version?")
    return (share / inside).resolve()


def read_urdf(specification: ArmSpecification) -> Description:
    """Read the URDF of a completed specification, reduced to the chain of the tool.

    Raises ArmError if the file is missing, malformed or not reducible to a chain, and
    UnknownNameError if a name stands for no arm, joint or link.
    """
    path = _find_urdf(specification.source)
    try:
        return _reduced(path, specification)
    except ArmError as error:
        raise ArmError(f"{path.name}: {error}") from error


def _reduced(path: Path, specification: ArmSpecification) -> Description:
    """Read a URDF, reduced to the tool's chain; errors lack the file's name."""
    robot = read_robot(path)
    joints = read_joints(robot)
    links = [link.get("name", "") for link in robot.findall("link")]
    with_mesh = [
        link.get("name", "")
        for link in robot.iterfind("link[collision]")
        if link.find("collision/geometry/mesh") is not None
    ]
    tool, notes = _tool_frame(specification.tool_frame, joints, links)
    asked, limits = specification.held or {}, specification.limits or {}
    moving = [joint.name for joint in joints.values() if joint.kind in MOVING]
    kept = [joint.name for joint in chain_to(tool, joints) if joint.name not in asked]
    contacts = [link for each in specification.allowed_contacts or () for link in each.links]
    bodies = specification.held_bodies or ()
    named_parts = [*links, *(body.name for body in bodies)]
    for what, named, known in (
        ("joint in held", asked, moving),
        ("joint in limits", limits, moving),
        ("joint in actuated", specification.actuated or (), kept),
        ("link with a mesh in pieces", specification.pieces or {}, with_mesh),
        ("link in held_bodies", [body.link for body in bodies], links),
        ("link in allowed_contacts", contacts, named_parts),
    ):
        check_known(f"{what} of {path.name}:", named, known)
    for body in bodies:
        if named_parts.count(body.name) > 1:
            raise ArmError(f"held body {body.name!r} needs a name of its own")
    _check_mimics([joints[name] for name in kept])
    for name in dict.fromkeys((*kept, *limits)):
        notes += _bounded(joints[name], limits.get(name))
    held = _held_positions(joints, moving, kept, asked)
    for name, position in held.items():
        _fix(joints[name], position)
    free = [name for name in held if name not in asked]
    if free:
        notes += (f"joints that do not carry the tool are held: {', '.join(free)}",)
    resolve_meshes(robot, path, specification.package_dirs)
    if specification.tool_offset is not None:
        tool = _add_tool_point(robot, tool, specification.tool_offset)
    try:
        text = ElementTree.tostring(robot, "unicode")
    except RecursionError:
        raise ArmError("not a readable URDF: it is nested too deeply") from None
    return Description(path, text, tool, held, notes)


def _tool_frame(
    asked: str | None, joints: Mapping[str, TreeJoint], links: list[str]
) -> tuple[str, tuple[str, ...]]:
    """The tool frame, with a note if it was chosen."""
    if asked is not None or USUAL_TOOL in links:
        chosen = asked or USUAL_TOOL
        if chosen not in links:
            raise ArmError(
                f"no tool frame {chosen!r}; tool_frame can be one of the links {', '.join(links)}"
            )
        return chosen, ()
    lengths = [sum(joint.mimics is None for joint in chain_to(link, joints)) for link in links]
    if not links or max(lengths) == 0:
        raise ArmError("no moving joint")
    longest = [link for link, n in zip(links, lengths, strict=True) if n == max(lengths)]
    parents = {joint.parent for joint in joints.values() if joint.child in longest}
    last = next(link for link in reversed(longest) if link not in parents)
    return last, (f"tool frame: {last!r}, the last link of the longest chain",)


def _check_mimics(chain: list[TreeJoint]) -> None:
    """Refuse joints that carry the tool and mimic others."""
    for number, joint in enumerate(chain):
        if joint.mimics is not None:
            mend = "hold it (held)"
            if joint.mimics not in [each.name for each in chain[:number]]:
                mend += f", or choose a tool frame before it: --tool-frame {joint.parent}"
            raise ArmError(
                f"joint {joint.name!r} mimics {joint.mimics!r} and carries the tool: {mend}"
            )


def _bounded(joint: TreeJoint, ends: tuple[float, float] | None) -> tuple[str, ...]:
    """Give a joint other limits, if there are some, and check them; return what was chosen."""
    element, name, notes = joint.element, joint.name, tuple[str, ...]()
    if joint.kind == "continuous":
        element.set("type", "revolute")
        if ends is None:
            ends = -math.pi, math.pi
            notes = (f"joint {name!r} is continuous: its range is taken as -180 to 180 deg",)
    limit = element.find("limit")
    if limit is None:
        if ends is None:
            raise ArmError(f"joint {name!r} has no limits")
        limit = ElementTree.SubElement(element, "limit", effort="0")
    if ends is not None:
        limit.attrib |= {"lower": repr(ends[0]), "upper": repr(ends[1])}
    lower, upper = (float(limit.attrib[end]) for end in ("lower", "upper"))
    if not -FARTHEST_POSITION <= lower < upper <= FARTHEST_POSITION:
        raise ArmError(f"joint {name!r} has no usable limits: {lower}..{upper}")
    return notes


def _held_positions(
    joints: Mapping[str, TreeJoint],
    moving: Collection[str],
    kept: Collection[str],
    asked: Mapping[str, float],
) -> dict[str, float]:
    """Where the moving joints stay that are not kept."""
    fixed = [joints[name] for name in moving if name not in kept]
    leaders = [joint for joint in fixed if joint.mimics is None or joint.name in asked]
    positions = {joint.name: asked.get(joint.name, _near_zero(joint)) for joint in leaders}
    for joint in fixed:
        leader, mimic = joint.mimics, joint.element.find("mimic")
        if joint.name in positions or mimic is None:
            continue
        if leader not in positions:
            why = "moves: hold it (held)" if leader in kept else "is no joint that is held"
            raise ArmError(f"joint {joint.name!r} mimics {leader!r}, which {why}")
        factor, offset = (float(mimic.attrib[name]) for name in ("multiplier", "offset"))
        positions[joint.name] = factor * positions[leader] + offset
    return {joint.name: positions[joint.name] for joint in fixed}


def _near_zero(joint: TreeJoint) -> float:
    """Position closest to zero within a joint's limits, if any."""
    limit = joint.element.find("limit")
    if limit is None or joint.element.get("type") == "continuous":
        return 0.0
    return min(max(0.0, float(limit.attrib["lower"])), float(limit.attrib["upper"]))


def _fix(joint: TreeJoint, position: float) -> None:
    """Fix a joint at a position."""
    element = joint.element
    element.set("type", "fixed")
    for mimic in element.findall("mimic"):
        element.remove(mimic)
    if position == 0:
        return
    attributes = {part.tag: part.attrib for part in element}
    origin, along = attributes["origin"], _numbers(attributes["axis"]["xyz"])
    along = along / np.linalg.norm(along)
    turned = pin.rpy.rpyToMatrix(_numbers(origin["rpy"]))
    moved = _numbers(origin["xyz"])
    if joint.kind == "prismatic":
        moved = moved + turned @ along * position
    else:
        turned = turned @ pin.AngleAxis(position, along).toRotationMatrix()
    origin["xyz"] = " ".join(map(repr, moved.tolist()))
    origin["rpy"] = " ".join(map(repr, pin.rpy.matrixToRpy(turned).tolist()))


def _numbers(text: str) -> NDArray[np.float64]:
    """Numbers of an attribute."""
    return np.array([float(word) for word in text.split()])


def _add_tool_point(robot: ElementTree.Element, tool: str, offset: tuple[float, ...]) -> str:
    """Add a link at a point of the tool frame; return its name."""
    name = f"{tool}_point"
    ElementTree.SubElement(robot, "link", name=name)
    joint = ElementTree.SubElement(robot, "joint", name=f"{name}_joint", type="fixed")
    ElementTree.SubElement(joint, "parent", link=tool)
    ElementTree.SubElement(joint, "child", link=name)
    ElementTree.SubElement(joint, "origin", xyz=" ".join(map(repr, offset)), rpy="0 0 0")
    return name
