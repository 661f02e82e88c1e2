"""Robot descriptions: what of a URDF an arm is made of, as a text that Pinocchio can read.

Of a tree of links, the joints between base and tool are kept. The others, and those that are to
be held, become fixed where they are held; joints that mimic a held one follow it. Continuous joints
get a range, and the names of meshes become paths.
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

from kinarm._files import absolute, first_line, is_file, is_folder
from kinarm.arm_specification import PACKAGE, ArmSpecification, arm_names
from kinarm.errors import ArmError, InvalidInputError, UnknownNameError
from kinarm.meshes import resolve_meshes
from kinarm.urdf_tree import (
    FARTHEST,
    FARTHEST_POSITION,
    MOVING,
    TreeJoint,
    chain_to,
    read_joints,
    read_robot,
)

USUAL_TOOL = "tool0"
"""Name of the tool frame by ROS's convention."""

FOLLOWING = (("multiplier", "1"), ("offset", "0"))
"""Attributes of a mimicking joint, and what they are where they are left out."""


class Description(NamedTuple):
    """A URDF made ready for an arm.

    Attributes
    ----------
    path : Path
        The file.
    text : str
        Its text, in which all moving joints are in series, from the base to the tool.
    links : tuple of str
        Names of all links.
    tool_frame : str
        Link whose origin is the tool point.
    held : dict
        Positions at which joints were fixed, by name [rad or m].
    notes : tuple of str
        What was chosen where nothing was said.
    """

    path: Path
    text: str
    links: tuple[str, ...]
    tool_frame: str
    held: dict[str, float]
    notes: tuple[str, ...]


def find_urdf(source: str) -> Path:
    """Resolve the source of a completed specification to a file.

    Raises
    ------
    ArmError
        If there is no such file.
    UnknownNameError
        If it is no path but a name.
    """
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
    """Find a file of the installed package of robot descriptions."""
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


def read_urdf(path: Path, specification: ArmSpecification) -> Description:
    """Read a URDF and reduce it to a chain.

    Parameters
    ----------
    path : Path
        The file.
    specification : ArmSpecification
        What of it is to be used; a completed one.

    Raises
    ------
    ArmError
        If the file is malformed, or the robot cannot be reduced to a chain.
    UnknownNameError
        If the specification names a joint that there is none of.
    """
    robot = read_robot(path)
    try:
        return _reduced(robot, path, specification)
    except InvalidInputError:
        raise
    except (ValueError, RecursionError) as error:
        raise ArmError(f"{path.name} is not a readable URDF: {first_line(error)}") from error


def _reduced(
    robot: ElementTree.Element, path: Path, specification: ArmSpecification
) -> Description:
    """Keep the chain that carries the tool."""
    joints = read_joints(robot, path)
    links = [link.get("name", "") for link in robot.findall("link")]
    tool, notes = _tool_frame(specification.tool_frame, joints, links, path)
    chain = chain_to(tool, joints)
    for what in ("held", "limits"):
        _check_joints(what, getattr(specification, what) or {}, joints, path)
    asked = specification.held or {}
    kept = [joint.name for joint in chain if joint.name not in asked]
    for joint in joints.values():
        if joint.name in kept:
            notes += _bounded(joint, specification.limits or {}, path)
    held = _held_positions(joints, kept, asked, path)
    for name, position in held.items():
        _fix(joints[name].element, position)
    free = [name for name in held if name not in asked]
    if free:
        notes += (f"joints that do not carry the tool are held: {', '.join(free)}",)
    resolve_meshes(robot, path, specification.package_dirs)
    if specification.tool_offset is not None:
        if not max(map(abs, specification.tool_offset)) <= FARTHEST:
            raise ArmError(
                f"tool_offset must be at most {FARTHEST:g} m, got {specification.tool_offset}"
            )
        tool = _add_tool_point(robot, tool, specification.tool_offset)
    return Description(
        path=path,
        text=ElementTree.tostring(robot, encoding="unicode"),
        links=tuple(links),
        tool_frame=tool,
        held=held,
        notes=notes,
    )


def _tool_frame(
    asked: str | None, joints: Mapping[str, TreeJoint], links: list[str], path: Path
) -> tuple[str, tuple[str, ...]]:
    """The tool frame, and a note if it had to be chosen."""
    if asked is not None or USUAL_TOOL in links:
        chosen = asked or USUAL_TOOL
        if chosen not in links:
            raise ArmError(
                f"{path.name} has no tool frame {chosen!r}; tool_frame can be one of its links: "
                + ", ".join(links)
            )
        return chosen, ()
    lengths = [sum(joint.mimics is None for joint in chain_to(link, joints)) for link in links]
    if not links or max(lengths) == 0:
        raise ArmError(f"{path.name} has no moving joint")
    longest = [link for link, n in zip(links, lengths, strict=True) if n == max(lengths)]
    parents = {joint.parent for joint in joints.values() if joint.child in longest}
    last = next(link for link in reversed(longest) if link not in parents)
    return last, (f"tool frame: {last!r}, the last link of the longest chain",)


def _check_joints(
    what: str, named: Collection[str], joints: Mapping[str, TreeJoint], path: Path
) -> None:
    """Refuse names that no moving joint has."""
    moving = [joint.name for joint in joints.values() if joint.kind in MOVING]
    for name in named:
        if name not in moving:
            raise UnknownNameError(f"joint in {what} of {path.name}:", name, moving)


def _bounded(
    joint: TreeJoint, limits: Mapping[str, tuple[float, float]], path: Path
) -> tuple[str, ...]:
    """See that a joint that is kept has limits; return what was chosen."""
    element, name = joint.element, joint.name
    if joint.mimics is not None:
        raise ArmError(
            f"joint {name!r} of {path.name} mimics {joint.mimics!r} and carries the tool: hold it "
            "(held), or choose a tool frame before it"
        )
    limit = element.find("limit")
    notes: tuple[str, ...] = ()
    if joint.kind == "continuous":
        element.set("type", "revolute")
        if limit is None:
            limit = ElementTree.SubElement(element, "limit", effort="0")
        if name not in limits:
            limit.set("lower", repr(-math.pi))
            limit.set("upper", repr(math.pi))
            notes = (f"joint {name!r} is continuous: its range is taken as -180 to 180 deg",)
    if limit is None:
        raise ArmError(f"joint {name!r} of {path.name} has no limits")
    if name in limits:
        for end, value in zip(("lower", "upper"), limits[name], strict=True):
            limit.set(end, repr(value))
    lower, upper = (float(limit.attrib[end]) for end in ("lower", "upper"))
    if not -FARTHEST_POSITION <= lower < upper <= FARTHEST_POSITION:
        raise ArmError(f"joint {name!r} of {path.name} has no usable limits: {lower}..{upper}")
    return notes


def _held_positions(
    joints: Mapping[str, TreeJoint], kept: Collection[str], asked: Mapping[str, float], path: Path
) -> dict[str, float]:
    """Where the joints stay that are not kept."""
    positions = {}
    for joint in joints.values():
        if joint.kind not in MOVING or joint.name in kept:
            continue
        if joint.mimics in kept and joint.name not in asked:
            raise ArmError(
                f"joint {joint.name!r} of {path.name} mimics {joint.mimics!r}, which moves: hold "
                "it (held)"
            )
        if joint.mimics is None or joint.name in asked:
            positions[joint.name] = asked.get(joint.name, _near_zero(joint))
    for joint in joints.values():
        leader = joint.mimics
        if joint.kind in MOVING and joint.name not in kept and joint.name not in positions:
            if leader not in positions:
                raise ArmError(
                    f"joint {joint.name!r} of {path.name} mimics {leader!r}, which is no joint "
                    "that is held"
                )
            mimic = joint.element.find("mimic")
            assert mimic is not None
            factor, offset = (float(mimic.get(name, d)) for name, d in FOLLOWING)
            positions[joint.name] = factor * positions[leader] + offset
    for name, position in positions.items():
        if not abs(position) <= FARTHEST_POSITION:
            raise ArmError(
                f"joint {name!r} of {path.name} cannot be held at {position}: positions are at "
                f"most {FARTHEST_POSITION:g}"
            )
    return {name: positions[name] for name in joints if name in positions}


def _near_zero(joint: TreeJoint) -> float:
    """Position closest to zero within the limits of a joint, if it has any."""
    limit = joint.element.find("limit")
    if limit is None or joint.kind == "continuous":
        return 0.0
    lower, upper = (float(limit.get(end, "0")) for end in ("lower", "upper"))
    return min(max(0.0, lower), upper)


def _fix(element: ElementTree.Element, position: float) -> None:
    """Make a joint a fixed one at a position."""
    kind = element.get("type")
    element.set("type", "fixed")
    mimic = element.find("mimic")
    if mimic is not None:
        element.remove(mimic)
    if position == 0:
        return
    origin, axis = element.find("origin"), element.find("axis")
    if origin is None:
        origin = ElementTree.SubElement(element, "origin")
    along = _numbers("1 0 0" if axis is None else axis.get("xyz", "1 0 0"))
    along = along / np.linalg.norm(along)
    turned = pin.rpy.rpyToMatrix(_numbers(origin.get("rpy", "0 0 0")))
    moved = _numbers(origin.get("xyz", "0 0 0"))
    if kind == "prismatic":
        moved = moved + turned @ along * position
    else:
        turned = turned @ pin.AngleAxis(position, along).toRotationMatrix()
    origin.set("xyz", " ".join(map(repr, moved.tolist())))
    origin.set("rpy", " ".join(map(repr, pin.rpy.matrixToRpy(turned).tolist())))


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
