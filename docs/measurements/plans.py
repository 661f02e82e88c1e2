"""Plans for MotionBenchMaker's problems for a UR5, and OMPL beside kinarm's planner.

``python -m docs.measurements.plans FOLDER`` records them: all with pieces of the arm's links, and
every fifth with hulls, and with OMPL. The folder is that of `docs.measurements.motionbenchmaker`.
OMPL is ``pip install ompl``. Times are those of a core.
"""

import json
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from docs.measurements.motionbenchmaker import Robot, problems_of, robot_arm
from kinarm import Arm, ProblemError, ReachProblem, World
from kinarm.policies import PlanSettings
from kinarm.policies.planning.motions import Motions
from kinarm.policies.planning.paths import find_path
from kinarm.policies.planning.timing import trajectory_of

RECORD = Path(__file__).resolve().parents[2] / "data/results/plans/motionbenchmaker.json"
SAMPLES, SECONDS = 20_000, 60.0
"""Where kinarm's planner and OMPL's give up."""

BESIDE = 5
"""Every so many problems are planned with hulls, and by OMPL."""

CHECKED = 100.0
"""Straight motions a second, into which a motion is cut to be proven free once more [1/s]."""

Array = NDArray[np.float64]


def timed(function: Callable[..., Any], *given: Any) -> tuple[Any, float]:
    """What a function returns, and how long it took [s]."""
    begun = time.process_time()
    return function(*given), time.process_time() - begun


def of_ompl(motions: Motions, start: Array, goal: Array) -> Array | None:
    """Path by OMPL's RRT-Connect and its simplification, with kinarm's test of motions."""
    from ompl import base, geometric, util

    util.setLogLevel(util.LOG_ERROR)
    util.RNG.setSeed(1)
    arm, n = motions.world.arm, len(start)
    space, bounds = base.RealVectorStateSpace(n), base.RealVectorBounds(n)
    for joint in range(n):
        bounds.setLow(joint, float(arm.lower[joint]))
        bounds.setHigh(joint, float(arm.upper[joint]))
    space.setBounds(bounds)
    information = base.SpaceInformation(space)

    class Validator(base.MotionValidator):  # type: ignore[misc]
        """Asks kinarm."""

        def checkMotion(self, first: Any, second: Any) -> bool:  # noqa: N802
            """Whether a straight motion is free."""
            ends = [np.array([state[joint] for joint in range(n)]) for state in (first, second)]
            return motions.free_share(*ends) == 1.0

    information.setStateValidityChecker(lambda _: True)
    information.setMotionValidator(Validator(information))
    information.setup()
    states = [space.allocState(), space.allocState()]
    for state, q in zip(states, (start, goal), strict=True):
        for joint in range(n):
            state[joint] = float(q[joint])
    problem = base.ProblemDefinition(information)
    problem.setStartAndGoalStates(*states)
    planner = geometric.RRTConnect(information)
    planner.setProblemDefinition(problem)
    planner.setup()
    planner.solve(SECONDS)
    if not problem.hasExactSolution():
        return None
    path = problem.getSolutionPath()
    geometric.PathSimplifier(information).simplifyMax(path)
    found = [path.getState(k) for k in range(path.getStateCount())]
    return np.array([[state[joint] for joint in range(n)] for state in found])


def measured(
    problem: ReachProblem, ends: Array, meshes: Robot | None, *, beside: bool
) -> dict[str, Any]:
    """Results for a problem; of its motion if there are meshes, and of OMPL ``beside`` it."""
    start, goal = ends
    try:
        world = World(problem, threads=1)
    except ProblemError:  # the start is in contact
        return {"free": False}
    if world.in_contact(ends).any():
        return {"free": False}
    found: dict[str, Any] = {"free": True}
    motions, limits = Motions(world), PlanSettings().limits(world.arm.velocity_limits)
    given = motions, start, goal[None], np.random.default_rng(0), SAMPLES
    path, found["seconds"] = timed(find_path, *given)
    found["solved"] = path is not None
    if path is not None and meshes is not None:
        motion, found["timing"] = timed(trajectory_of, path, limits, motions)
        straight = trajectory_of(ends, limits, motions)
        times = np.append(np.arange(0.0, motion.duration, 1 / CHECKED), motion.duration)
        q = motion.at(times)
        found["proven"] = all(motions.free_share(*way) == 1.0 for way in pairwise(q))
        found["touches"] = any(meshes.contact_pairs(problem.scene, q[:: int(CHECKED // 2)]))
        found["ratio"] = motion.duration / straight.duration
        shares = [np.abs(motion.at(times, 1 + k)) / limit for k, limit in enumerate(limits)]
        found["largest"] = float(np.max(shares))
    if beside:
        other, found["ompl seconds"] = timed(of_ompl, motions, start, goal)
        found["ompl solved"] = other is not None
    return found


def summaries(results: list[dict[str, Any]]) -> dict[str, Any]:
    """Counts, and medians, 95 % quantiles and extremes, of each set and of all."""
    told: dict[str, Any] = {}
    for name in (*dict.fromkeys(each["set"] for each in results), "all"):
        members = [each for each in results if name in ("all", each["set"])]
        of: dict[str, Any] = {"problems": len(members)}
        for key in ("free", "solved", "proven", "touches", "ompl solved"):
            if verdicts := [each[key] for each in members if key in each]:
                of[key], of[f"{key} of"] = sum(verdicts), len(verdicts)
        for key in ("seconds", "timing", "ratio", "largest", "ompl seconds"):
            if values := [each[key] for each in members if key in each]:
                of[key] = [round(float(np.quantile(values, q)), 5) for q in (0.5, 0.95, 1.0)]
        told[name] = of
    return told


def main(folder: Path) -> None:
    """Record a summary of each set, and of all, for arms with pieces and with hulls."""
    record = {}
    for kind in ("pieces", "hulls"):
        arm, meshes = arm_of(folder, kind), Robot.of_urdf(folder) if kind == "pieces" else None
        results = []
        for number, (scenes, *given) in enumerate(problems_of(folder, arm.specification)):
            beside = number % BESIDE == 0
            if meshes is not None or beside:
                found = measured(*given, meshes, beside=beside and meshes is not None)
                results.append({"set": scenes, **found})
                sys.stderr.write(f"{number} {results[-1]}\n")
        record[kind] = summaries(results)
    RECORD.parent.mkdir(exist_ok=True)
    RECORD.write_text(json.dumps(record, indent=1) + "\n")


def arm_of(folder: Path, kind: str) -> Arm:
    """The UR5 with pieces or hulls, all of whose joints move."""
    specification = robot_arm(folder)
    if kind == "hulls":
        specification = replace(specification, pieces=None)
    return Arm.load(replace(specification, actuated=Arm.load(specification).joint_names))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
