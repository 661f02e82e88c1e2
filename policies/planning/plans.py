"""Plans: motions of an arm from rest to rest that touch nothing, with a time law."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kinarm._files import write_text
from kinarm.arm import Arm
from kinarm.bodies import rotation_matrix
from kinarm.errors import POSITIVE, InvalidInputError, NoPathError, check_range, finite_array
from kinarm.kernels.compiling import Array
from kinarm.policies.planning.motions import Motions
from kinarm.policies.planning.paths import find_path
from kinarm.policies.planning.settings import PARTS, Kind, Limits, PlanSettings
from kinarm.policies.planning.timing import Trajectory, trajectory_of
from kinarm.problem import ProblemLike, ReachProblem
from kinarm.recording import Recording, record_path
from kinarm.world import World

PATHS = 4
"""Paths that are planned; the one of the fastest motion counts."""

LONGEST_STEP = 0.02
"""Longest step of a recording, in which the arm moves straight [s]."""

DERIVATIVES = ("positions", "velocities", "accelerations")


@dataclass(frozen=True, eq=False)
class Plan:
    """A motion from rest to rest that touches nothing.

    Attributes
    ----------
    problem : ReachProblem
        Arm and scene; all joints of the arm are actuated.
    joint_names : tuple of str
        The arm's joints.
    goal : ndarray, shape (3,)
        Where the tool is to be in the end [m].
    waypoints : ndarray, shape (m, n_joints)
        Corners of the path; the motion rounds those between [rad or m].
    trajectory : Trajectory
        The motion as polynomials of time; its ``at(times, derivative)`` gives
        positions, velocities, accelerations or jerks.
    limits : Limits
        What it keeps.
    proven : str
        What is proven of it, in a sentence.
    """

    problem: ReachProblem
    joint_names: tuple[str, ...]
    goal: Array
    waypoints: Array
    trajectory: Trajectory
    limits: Limits
    proven: str

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return self.trajectory.duration

    def __repr__(self) -> str:
        return f"Plan({len(self.waypoints)} waypoints, {self.duration:.3f} s)"

    def times(self, rate: float = 100.0) -> Array:
        """Times at a rate [Hz], from 0 to the end, which is the last one [s]."""
        check_range("rate", rate, POSITIVE)
        times = np.arange(int(np.ceil(self.duration * rate - 1e-9)) + 1) / rate
        times[-1] = self.duration
        return times

    def save_csv(self, path: str | Path, rate: float = 100.0) -> None:
        """Write a row for each time: it, positions, velocities and accelerations."""
        names = [f"{name}_{part}" for part in DERIVATIVES for name in self.joint_names]
        times = self.times(rate)
        columns = [times[:, None], *(self.trajectory.at(times, k) for k in range(3))]
        rows = [map(repr, row) for row in np.concatenate(columns, axis=1).tolist()]
        write_text(path, "".join(f"{','.join(row)}\n" for row in (["time", *names], *rows)))

    def to_ros(self, rate: float = 100.0) -> dict[str, Any]:
        """The fields of a ``trajectory_msgs/JointTrajectory`` of ROS, as plain values."""
        times = self.times(rate)
        rows = zip(times, *(self.trajectory.at(times, k) for k in range(3)), strict=True)
        points: list[dict[str, Any]] = []
        for time, *values in rows:
            point = {part: each.tolist() for part, each in zip(DERIVATIVES, values, strict=True)}
            second, nanosecond = divmod(round(time * 1e9), 1_000_000_000)
            points.append({**point, "time_from_start": {"sec": second, "nanosec": nanosecond}})
        return {"joint_names": list(self.joint_names), "points": points}

    def save_json(self, path: str | Path, rate: float = 100.0) -> None:
        """Write `to_ros` as JSON."""
        write_text(path, json.dumps(self.to_ros(rate), indent=1) + "\n")

    def recording(self) -> Recording:
        """A recording of it, a state for each time step of the problem, tested once more."""
        step = min(self.problem.stepping.time_step, LONGEST_STEP)
        world = World(self.problem.replace(time_step=step))
        states = self.trajectory.at(self.times(1.0 / step))
        goal = world.reached(states[-1:])[0]
        goal[:3] = self.goal
        return record_path(world, states, goal=goal, name="plan")


def plan(problem: ProblemLike, start: ArrayLike | None, goal: ArrayLike, **settings: Any) -> Plan:
    """Plan a motion of all joints from rest to rest that touches nothing at any time.

    The same inputs give the same plan on every machine.

    Parameters
    ----------
    problem : ReachProblem, str or Path
        Arm and scene. Random bodies are those of the episode with this start, whose goal lies
        exactly where this one brings the tool: give its position, if its rest is drawn.
    start, goal : array_like
        Where it begins and ends, as their kinds in the settings say. It begins
        at home if ``start`` is None.
    **settings
        Fields of `PlanSettings`.

    Raises
    ------
    InvalidInputError
        If start or goal is out of reach, in contact or closer than the margin,
        or bodies of the scene move.
    NoPathError
        If no path is found.
    """
    wanted = PlanSettings(**settings)
    world, joints = _world_of_all_joints(ReachProblem.load(problem))
    limits, arm = wanted.limits(world.arm.velocity_limits), world.arm
    aim = finite_array("goal", goal, (PARTS.get(wanted.goal_kind, arm.n_joints),))
    place = aim[:3] if wanted.goal_kind in PARTS else world.reached(aim[None])[0, :3]
    if start is None and wanted.start_kind != "configuration":
        raise InvalidInputError(f"no start is given, of which start_kind is {wanted.start_kind!r}")
    begin = arm.home if start is None else start
    starts = _reaching(world, wanted.start_kind, begin, "start", arm.home, joints)
    first = _far_enough(Motions(world, wanted.margin), "start", starts)[0]
    world = world.in_scene(first, place)
    motions, rng = Motions(world, wanted.margin), np.random.default_rng(wanted.seed)
    _far_enough(motions, "start", first[None])
    ends = _reaching(world, wanted.goal_kind, aim, "goal", first, joints)
    ends = _far_enough(motions, "goal", ends)
    found = []
    for _ in range(PATHS):
        path = find_path(motions, first, ends, rng, wanted.samples)
        if path is None:
            raise NoPathError(wanted.samples)
        found.append((path, trajectory_of(path, limits, motions)))
        if len(path) == 2:
            break
    path, trajectory = min(found, key=lambda each: each[1].duration)
    apart = f"come within {wanted.margin:g} m" if wanted.margin else "touch"
    proven = f"none of the {len(world.contact_model.pair_names)} tested pairs of bodies {apart}"
    return Plan(
        problem=world.problem,
        joint_names=arm.joint_names,
        goal=place,
        waypoints=path,
        trajectory=trajectory,
        limits=limits,
        proven=f"{proven} at any time of the motion",
    )


def _far_enough(motions: Motions, what: str, configurations: Array) -> Array:
    """Configurations that touch nothing and keep the margin; InvalidInputError if none does."""
    pairs = motions.world.contact_pairs(configurations)
    if all(pairs):
        raise InvalidInputError(f"{what} is in contact: {' touches '.join(pairs[0] or ())}")
    configurations = configurations[[pair is None for pair in pairs]]
    kept = [motions.free_share(q, q) == 1.0 for q in configurations]
    if not any(kept):
        raise InvalidInputError(f"{what} is closer to contact than {motions.margin:g} m")
    return configurations[kept]


def _world_of_all_joints(problem: ReachProblem) -> tuple[World, int]:
    """The world of a problem, all of whose joints are actuated, and how many move the tool."""
    if moving := [problem.scene.bodies[body].name for body in problem.scene.moving]:
        raise InvalidInputError(
            f"a plan knows no time at which it begins, and {', '.join(moving)} of the scene of "
            f"{problem.name} moves"
        )
    arm = Arm.load(replace(problem.arm, actuated=None, digest=None))
    moved = replace(problem.arm, actuated=arm.joint_names, digest=None)
    return World(problem.replace(arm=moved), threads=1), arm.n_actuated


def _reaching(
    world: World, kind: Kind, given: ArrayLike, what: str, near: Array, joints: int
) -> Array:
    """Configurations of a kind of start or goal, the nearest one first, shape (k, n_joints).

    For a position alone, only so many joints move.
    """
    numbers = finite_array(what, given, (PARTS.get(kind, world.arm.n_joints),))
    if kind == "configuration":
        found = world.arm.chain.within_limits(what, numbers, world.arm.joint_names)[None]
    else:
        aim = numbers[:3]
        if kind == "pose":
            aim = np.eye(4)
            aim[:3, :3], aim[:3, 3] = rotation_matrix((*numbers[3:].tolist(),)), numbers[:3]
        found = world.inverse_kinematics(
            aim,
            numbers[3:] if kind == "direction" else None,
            near=near,
            joints=joints if kind == "position" else None,
            turns=True,
        ).configurations
    if len(found) == 0:
        said = " ".join(map(str, numbers.tolist()))
        raise InvalidInputError(f"{what} is out of reach: no configuration is found for {said}")
    return found
