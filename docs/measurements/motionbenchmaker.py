"""Are start and goal free in MotionBenchMaker's problems for a UR5? By kinarm and by Coal.

``python -m docs.measurements.motionbenchmaker FOLDER`` prints a table, and which pairs of bodies
make the difference. The folder is ``resources/ur5`` of the sources of vamp-planner, with the robot
in ``ur5.urdf`` and ``ur5.srdf`` and the problems in ``problems.tar.bz2``.
"""

import sys
import tarfile
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from docs.measurements.self_contact import pieces_of
from kinarm import Arm, ArmSpecification, Mount, ReachProblem, Scene
from kinarm.collision import ContactModel
from kinarm.contact_pairs import make_verdicts_reliable
from kinarm.evaluation.report.templating import markdown_table
from kinarm.meshes import coal_shape
from kinarm.moveit import import_problem

Pair = tuple[str, str] | None
"""Names of two bodies that touch; None if nothing does."""

HEADER = ("problems", "hulls", "pieces", "meshes")
"""The last columns have the free starts, the free goals, and how often both are."""


class Robot(NamedTuple):
    """Joints and shapes of a robot, with the pairs within it that are tested."""

    model: pin.Model
    geometry: pin.GeometryModel

    @classmethod
    def of_kinarm(cls, arm: Arm) -> "Robot":
        """An arm as kinarm tests it: with hulls or pieces of its meshes."""
        contact = ContactModel.build(arm, Scene(ground=False, obstacles=()))
        return cls(arm.model, contact.geometry)

    @classmethod
    def of_urdf(cls, folder: Path) -> "Robot":
        """The robot as Pinocchio reads it: with its meshes, and the pairs that the SRDF leaves."""
        text = (folder / "ur5.urdf").read_text().replace('"meshes/', '"package://meshes/')
        model, kind = pin.buildModelFromXML(text), pin.GeometryType.COLLISION
        geometry = pin.buildGeomFromUrdfString(model, text, kind, package_dirs=[str(folder)])
        geometry.addAllCollisionPairs()
        pin.removeCollisionPairs(model, geometry, str(folder / "ur5.srdf"))
        return cls(model, geometry)

    def contact_pairs(self, scene: Scene, configurations: NDArray[np.float64]) -> list[Pair]:
        """First pair that touches by Coal at each configuration, shape (n, 6) [rad]."""
        geometry = self.geometry.copy()
        for body in scene.bodies:
            place = pin.SE3(body.rotation, np.array(body.position))
            shape = pin.GeometryObject(body.name, 0, 0, place, coal_shape(body))
            added = geometry.addGeometryObject(shape)
            for link, moving in enumerate(self.geometry.geometryObjects):
                if moving.parentJoint > 0:
                    geometry.addCollisionPair(pin.CollisionPair(link, added))
        data, placed = self.model.createData(), make_verdicts_reliable(geometry.createData())
        names, found = [shape.name for shape in geometry.geometryObjects], []
        for q in configurations:
            pin.computeCollisions(self.model, data, geometry, placed, q, False)
            results = zip(geometry.collisionPairs, placed.collisionResults, strict=True)
            touching = (pair for pair, result in results if result.isCollision())
            first = next(touching, None)
            found.append(first and (names[first.first], names[first.second]))
        return found


def robot_arm(folder: Path) -> ArmSpecification:
    """The UR5 of a folder, with its hollow links cut into pieces."""
    return ArmSpecification(
        source=str(folder / "ur5.urdf"),
        tool_frame="tool0",
        home=(0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0),
        pieces=pieces_of("ur5"),
    )


def problems_of(
    folder: Path, arm: ArmSpecification
) -> Iterator[tuple[str, ReachProblem, NDArray[np.float64]]]:
    """Name of the set, problem, and its start and goal, of each problem of a folder."""
    with tempfile.TemporaryDirectory() as place:
        with tarfile.open(folder / "problems.tar.bz2") as archive:
            archive.extractall(place, filter="data")
        yield from problems_in(Path(place, "problems"), arm)


def problems_in(
    folder: Path, arm: ArmSpecification
) -> Iterator[tuple[str, ReachProblem, NDArray[np.float64]]]:
    """The same, of the folder that ``problems.tar.bz2`` holds."""
    for scene in sorted(folder.glob("*/scene*.yaml")):
        request = scene.with_name(scene.name.replace("scene", "request"))
        yield scene.parent.name, *import_problem(scene, request, arm, Mount())


def main(folder: Path) -> None:
    """Print the table, and pairs of bodies by which a verdict differs from Coal's with meshes."""
    specification = robot_arm(folder)
    hulls, pieces = replace(specification, pieces=None), specification
    arms = [Arm.load(hulls), Arm.load(pieces)]
    robots = [*map(Robot.of_kinarm, arms), Robot.of_urdf(folder)]
    rows, differing, free = [], Counter(), np.zeros((3, 3), dtype=int)
    for scenes, members in groupby(problems_of(folder, hulls), key=itemgetter(0)):
        counts = np.zeros_like(free)
        for _, problem, q in members:
            *ours, meshes = (robot.contact_pairs(problem.scene, q) for robot in robots)
            for row, pairs in enumerate((*ours, meshes)):
                start, goal = (pair is None for pair in pairs)
                counts[row] += (start, goal, start and goal)
            for name, pairs in zip(HEADER[1:], ours, strict=False):
                differing.update(
                    f"{name}: {' and '.join(pair or other)} {'touch' if pair else 'do not'}"
                    for pair, other in zip(pairs, meshes, strict=True)
                    if (pair is None) != (other is None)
                )
        rows.append([f"`{scenes}`", *map(_cell, counts)])
        free += counts
        sys.stderr.write(f"{' | '.join(rows[-1])}\n")
    print(markdown_table(HEADER, [*rows, ["all", *map(_cell, free)]]))
    for told, count in sorted(differing.items()):
        print(f"{count:4}  {told}")


def _cell(counts: NDArray[np.int64]) -> str:
    return ", ".join(map(str, counts))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
