"""Planning scenes and requests of MoveIt, in YAML files such as MotionBenchMaker writes.

What cannot be read is an `InvalidInputError` that names file and key.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kinarm._fields import from_plain
from kinarm._files import reading
from kinarm.arm import Arm
from kinarm.arm_specification import ArmSpecification
from kinarm.bodies import Body, HeldBody
from kinarm.errors import InvalidInputError, KinarmError, finite_array, needed
from kinarm.problem import ReachProblem
from kinarm.scene import GoalRegion, Mount, Scene
from kinarm.task import ReachTask

PRIMITIVES = {"box": (0, 1, 2), "sphere": (0,), "cylinder": (1, 0)}
"""Solids, and which of MoveIt's dimensions are the sizes of a `Body`."""


class Entry:
    """A value of a YAML file, which knows its file and its keys there."""

    def __init__(self, value: Any, file: Path, keys: str = "") -> None:
        self.value, self.file, self.keys = value, file, keys

    @classmethod
    def of_file(cls, file: Path, kind: str) -> "Entry":
        """All of a file of MoveIt, such as a ``"planning scene"``."""
        yaml = needed("yaml", "PyYAML", "robots")
        with reading(repr(str(file)), kind, InvalidInputError, of="MoveIt"):
            return cls(yaml.safe_load(file.read_bytes()), file)

    def refusal(self, said: object) -> InvalidInputError:
        """An error about this entry."""
        return InvalidInputError(f"{self.file}: {self.keys and self.keys + ': '}{said}")

    def at(self, key: str, default: Any = None) -> "Entry":
        """The value of a key, which must be there if it has no default."""
        if not isinstance(self.value, Mapping):
            raise self.refusal(f"must be a table, got {self.value!r}")
        value = default if self.value.get(key) is None else self.value[key]
        if value is None:
            raise self.refusal(f"{key!r} is missing")
        return Entry(value, self.file, f"{self.keys}.{key}".lstrip("."))

    def each(self, key: str) -> list["Entry"]:
        """The members of a list; none if there is no such key."""
        listed = self.at(key, [])
        if not isinstance(listed.value, list):
            raise listed.refusal(f"must be a list, got {listed.value!r}")
        members = enumerate(listed.value)
        return [Entry(each, self.file, f"{listed.keys}[{n}]") for n, each in members]

    def refuse(self, *keys: str) -> None:
        """Refuse what a problem has no place for."""
        for key in keys:
            if self.at(key, []).value:
                raise self.refusal(f"{key!r} cannot be imported")

    def __str__(self) -> str:
        return str(self.value)

    def numbers(self, *shape: int | None) -> NDArray[np.float64]:
        """The value as finite numbers of a shape."""
        return finite_array(f"{self.file}: {self.keys}", self.value, shape)

    def pose(self, position: str = "position", rotation: str = "orientation") -> pin.SE3:
        """The value as a pose [m], whose quaternion is x, y, z, w."""
        turn = self.at(rotation).numbers(4)
        if not 0.99 < (turn * turn).sum() < 1.01:
            raise self.at(rotation).refusal("must be a quaternion of length 1")
        return pin.SE3(pin.Quaternion(turn).normalized(), self.at(position).numbers(3))


def import_problem(
    scene: Path, request: Path, arm: ArmSpecification, mount: Mount
) -> tuple[ReachProblem, NDArray[np.float64]]:
    """Make a problem of a planning scene and a request with a goal in joint space.

    Returns also start and goal, shape (2, n_joints) [rad or m]. The problem is to
    bring the tool from one to where it is at the other, in 1000 steps.

    Parameters
    ----------
    scene, request : Path
        YAML files.
    arm, mount : ArmSpecification and Mount
        The arm, and where its base stands in the fixed frame of the scene.
    """
    here, asked = Entry.of_file(scene, "scene"), Entry.of_file(request, "request")
    asked.refuse("path_constraints", "trajectory_constraints")
    state, bare = asked.at("start_state"), Arm.load(arm).placed(mount.position, mount.rotation)
    joints = state.at("joint_state")
    names = [str(each) for each in joints.each("name")]
    positions = dict(zip(names, joints.at("position").numbers(len(names)), strict=True))
    start, goal = _configuration(joints, positions, bare), _goal(asked, bare)
    tool = np.round(bare.tool_position(goal), 9)
    edge = np.array([1e-6, 1e-6, 0.0])  # a region has an area
    lower, upper = (tool - edge).tolist(), (tool + edge).tolist()
    obstacles = _obstacles(here)
    held, attached = [*bare.held_bodies], "attached_collision_objects"
    for each in state.each(attached) or here.at("robot_state", {}).each(attached):
        link = str(each.at("link_name"))
        own = dict.fromkeys(("", link), pin.SE3(1))
        held += _bodies(each.at("object"), own, HeldBody, link=link)
    try:
        problem = ReachProblem(
            name=scene.stem,
            arm=replace(arm, held_bodies=tuple(held) or None),
            scene=Scene(
                ground=False,
                obstacles=obstacles,
                goal_regions=(GoalRegion(name="goal", lower=lower, upper=upper),),
                mount=mount,
            ),
            task=ReachTask(starts=(start.tolist(),), horizon=1000),
        )
    except KinarmError as error:
        raise here.refusal(error) from error
    return problem, np.array([start, goal])


def _goal(request: Entry, arm: Arm) -> NDArray[np.float64]:
    goals = request.each("goal_constraints")
    if len(goals) != 1:
        raise request.refusal(f"'goal_constraints' must have one member, got {len(goals)}")
    goals[0].refuse("position_constraints", "orientation_constraints", "visibility_constraints")
    joints = goals[0].each("joint_constraints")
    positions = {str(each.at("joint_name")): each.at("position").numbers() for each in joints}
    return _configuration(goals[0], positions, arm)


def _configuration(entry: Entry, given: Mapping[str, Any], arm: Arm) -> NDArray[np.float64]:
    """Positions of an arm's joints [rad or m], of those that are given."""
    if lacking := [name for name in arm.joint_names if name not in given]:
        raise entry.refusal(f"{', '.join(lacking)} of arm {arm.name!r} is missing")
    q = np.array([given[name] for name in arm.joint_names], dtype=np.float64)
    return arm.chain.within_limits(f"{entry.file}: {entry.keys}", q, arm.joint_names)


def _obstacles(scene: Entry) -> tuple[Body, ...]:
    """Collision objects in the fixed frame of a scene."""
    world = scene.at("world")
    world.refuse("octomap")
    frames = {"": pin.SE3(1)} | {
        str(each.at("child_frame_id")): each.at("transform").pose("translation", "rotation")
        for each in scene.each("fixed_frame_transforms")
    }
    objects = world.each("collision_objects")
    return tuple(body for each in objects for body in _bodies(each, frames, Body))


def _bodies(
    entry: Entry, frames: Mapping[str, pin.SE3], kind: type[Body], **more: str
) -> list[Any]:
    """Bodies of a collision object, with what else their kind needs."""
    entry.refuse("planes")
    name, frame = str(entry.at("id")), str(entry.at("header", {}).at("frame_id", ""))
    if frame not in frames:
        fixed = ", ".join(filter(None, frames))
        raise entry.refusal(f"header.frame_id {frame!r} is none of the fixed frames {fixed}")
    place = frames[frame] * (entry.at("pose").pose() if "pose" in entry.value else pin.SE3(1))
    shapes = [*entry.each("primitives"), *entry.each("meshes")]
    poses = [*entry.each("primitive_poses"), *entry.each("mesh_poses")]
    if not 0 < len(shapes) == len(poses):
        raise entry.refusal(f"has {len(shapes)} primitives and meshes, and {len(poses)} poses")
    bodies = []
    for number, (shape, pose) in enumerate(zip(shapes, poses, strict=True), 1):
        *position, x, y, z, w = np.round(pin.SE3ToXYZQUAT(place * pose.pose()), 12).tolist()
        placed = {"position": position, "quaternion": [w, x, y, z], **_shape(shape), **more}
        placed["name"] = name if len(shapes) == 1 else f"{name} {number}"
        bodies.append(from_plain(kind, placed, str(shape.file), f"{shape.keys}."))
    return bodies


def _shape(entry: Entry) -> dict[str, Any]:
    """Shape and size of a solid, or vertices of a mesh, as a body has them."""
    shape = str(entry.at("type", "mesh"))
    if shape == "mesh":
        return {"shape": shape, "vertices": entry.at("vertices").numbers(None, 3).tolist()}
    if shape not in PRIMITIVES:
        raise entry.refusal(f"type {shape!r} is none of {', '.join(PRIMITIVES)}")
    size = entry.at("dimensions").numbers(len(PRIMITIVES[shape]))
    return {"shape": shape, "size": size[list(PRIMITIVES[shape])].tolist()}
