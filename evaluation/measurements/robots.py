"""Arms whose shapes are meshes, from example-robot-data: how fast rollouts with hulls are."""

from functools import cache
from importlib import metadata
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple
from xml.etree import ElementTree

from kinarm.arm_specification import ArmSpecification
from kinarm.errors import MissingExtraError
from kinarm.evaluation.measurements.rollouts import measure_rollouts
from kinarm.policies.learners import train_policy
from kinarm.policies.policy import Policy
from kinarm.policies.recipes import recipe
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.simulator import Simulator

PACKAGE, EXTRA = "example-robot-data", "robots"
ROBOT_BATCH = 512
TRAINING_ITERATIONS = 20
"""Iterations of ARS after which a policy no longer acts at random."""


class Robot(NamedTuple):
    """An arm of example-robot-data.

    Attributes
    ----------
    urdf : str
        Its file below the folder of robots.
    tool_frame : str
        The frame that is to reach goals.
    held : tuple of str
        Joints that are none of the arm's, which are fixed.
    """

    urdf: str
    tool_frame: str
    held: tuple[str, ...] = ()


ROBOTS = {
    "ur5": Robot("ur_description/urdf/ur5_robot.urdf", "tool0"),
    "panda": Robot(
        "panda_description/urdf/panda.urdf",
        "panda_hand_tcp",
        ("panda_finger_joint1", "panda_finger_joint2"),
    ),
}


def measure_robots(repetitions: int) -> list[dict[str, Any]]:
    """Rates as of `measure_rollouts`, with an entry ``arm``; or why there are none."""
    rows: list[dict[str, Any]] = []
    for name in ROBOTS:
        try:
            policy = novice(name)
        except MissingExtraError as error:
            return [{"skipped": str(error)}]
        simulator = Simulator(policy.problem)
        measured = measure_rollouts(simulator, policy, ROBOT_BATCH, repetitions)
        rows += [{"arm": name, **row} for row in measured]
    return rows


@cache
def novice(name: str) -> Policy:
    """A linear policy of a robot, trained for seconds, so that episodes are no random walks.

    Raises
    ------
    MissingExtraError
        If example-robot-data is not installed.
    """
    config = recipe("ars", "paper", problem=robot_problem(name), iterations=TRAINING_ITERATIONS)
    return train_policy(config).policy


@cache
def robot_problem(name: str) -> ReachProblem:
    """The paper's task on the right with a robot of example-robot-data.

    Raises
    ------
    MissingExtraError
        If example-robot-data is not installed.
    """
    robot, folder = ROBOTS[name], robots_folder()
    urdf, share = folder / robot.urdf, folder.parent.parent
    if robot.held:
        urdf = _with_fixed_joints(urdf, robot.held, Path(_made_files().name) / f"{name}.urdf")
    specification = ArmSpecification(
        source=str(urdf), tool_frame=robot.tool_frame, package_dirs=(str(share),)
    )
    return PROBLEMS["right"].replace(name=name, arm=specification)


def robots_folder() -> Path:
    """Where example-robot-data keeps its robots.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        files = metadata.files(PACKAGE) or []
    except metadata.PackageNotFoundError:
        raise MissingExtraError(PACKAGE, EXTRA) from None
    last = ROBOTS["ur5"].urdf
    for file in files:
        if str(file).endswith(f"/robots/{last}"):
            return Path(str(file.locate())).resolve().parents[last.count("/")]
    raise MissingExtraError(PACKAGE, EXTRA)


@cache
def _made_files() -> TemporaryDirectory[str]:
    """A folder that lasts as long as the process, since arms are read when they are used."""
    return TemporaryDirectory(prefix="kinarm-robots-")


def _with_fixed_joints(urdf: Path, names: tuple[str, ...], made: Path) -> Path:
    """Write a copy of a URDF in which some joints are fixed."""
    tree = ElementTree.parse(urdf)
    for joint in tree.getroot().findall("joint"):
        if joint.get("name") in names:
            joint.set("type", "fixed")
            for mimic in joint.findall("mimic"):
                joint.remove(mimic)
    tree.write(made)
    return made
