"""The observation: its parts in a table, each with its formula.

A new part is a function that writes it and an entry of `OBSERVATION`; all else follows. A problem
chooses some (`kinarm.Observation`).
"""

from collections.abc import Iterator, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from kinarm.errors import LARGEST
from kinarm.goals import REST_PARTS
from kinarm.kernels.compiling import Array, Stage, inlined
from kinarm.kernels.elementary import sine_cosine
from kinarm.kernels.goal_parts import (
    write_goal,
    write_offset,
    write_resolved_rate,
    write_rest,
    write_rest_error,
)
from kinarm.kernels.kinematics import to_world
from kinarm.kernels.plant import COMMAND
from kinarm.kernels.session import Session
from kinarm.kernels.surroundings import NEAR, Seen, write_obstacles, write_proximity
from kinarm.kernels.work_space import POSES
from kinarm.observation_part import ACTUATED, JOINTS, ONCE, SLOTS, UNIT, Part, Ranges
from kinarm.scene import Scene

if TYPE_CHECKING:
    from kinarm.arm import Arm

VERSION = 1
"""To be raised when a part's meaning changes, but not its name and length."""


def _of_frames(first: int, entries: int) -> Any:
    """The formula of some entries of each joint frame."""

    @inlined
    def write(session: Session, seen: Seen, start: int, count: int) -> None:
        for k in range(count):
            row = start + entries * k
            for i in range(entries):
                session.block.observation[0, row + i] = seen.frames[k + 1, first + i]

    return write


@inlined
def _write_joints(session: Session, seen: Seen, start: int, count: int) -> None:
    """Joint positions."""
    for k in range(count):
        session.block.observation[0, start + k] = seen.joints[0, k]


@inlined
def _write_angles(session: Session, seen: Seen, start: int, count: int) -> None:
    """Sine and cosine of the joint angles."""
    for k in range(count):
        sine, cosine = sine_cosine(seen.joints[0, k])
        session.block.observation[0, start + 2 * k] = sine
        session.block.observation[0, start + 2 * k + 1] = cosine


@inlined
def _write_velocities(session: Session, seen: Seen, start: int, count: int) -> None:
    """Moves in the last step, by the largest ones."""
    for k in range(count):
        moved = (seen.joints[0, k] - seen.before[0, k]) / session.rules.step_limit[k]
        session.block.observation[0, start + k] = moved


@inlined
def _write_action(session: Session, seen: Seen, start: int, count: int) -> None:
    """The last action, clipped."""
    for k in range(count):
        session.block.observation[0, start + k] = session.block.action[0, k]


@inlined
def _write_commanded(session: Session, seen: Seen, start: int, count: int) -> None:
    """Joint positions that were commanded: without a plant, those that are."""
    drive = session.block.drive
    for k in range(count):
        commanded = seen.joints[0, k]
        if session.block.plant.shape[0] > 0 and k < drive.shape[1]:
            commanded = drive[COMMAND, k]
        session.block.observation[0, start + k] = commanded


@inlined
def _write_time(session: Session, seen: Seen, start: int, count: int) -> None:
    """Share of the horizon that is left."""
    horizon = session.rules.horizon
    session.block.observation[0, start] = (horizon - session.block.steps[0]) / horizon


def _slides(arm: "Arm", _: Scene) -> str:
    sliding = [arm.joint_names[k] for k in np.flatnonzero(arm.chain.prismatic)]
    return f"joint {sliding[0]} slides; joint_positions takes it" if sliding else ""


def _is_bare(_: "Arm", scene: Scene) -> str:
    return "" if scene.bodies else "the scene has neither bodies nor ground"


def _has_no_obstacles(_: "Arm", scene: Scene) -> str:
    boxed = any(body.shape != "halfspace" for body in scene.bodies)
    return "" if boxed else "the scene has no bodies but half-spaces"


POLAR = (1, -1, 1)
"""Signs of a vector in the reflection y -> -y."""


def _rest_parts(
    kind: str, meaning: str, signs: tuple[int, ...], of: str = ONCE, unit: str = "1"
) -> Iterator[Part]:
    """The rest of a kind of goals, and its error."""
    rest, missing = REST_PARTS[kind]
    for name, write, error in ((rest, write_rest, False), (missing, write_rest_error, True)):

        def bounds(ranges: Ranges, error: bool = error) -> tuple[Array | float, Array | float]:
            lower, upper = (ranges.lower, ranges.upper) if of == JOINTS else (-UNIT, UNIT)
            return (lower - upper, upper - lower) if error else (lower, upper)

        less = " of the goal less that of the tool (the nearer of two quaternions)"
        yield Part(
            name=name,
            meaning=meaning + (less if error else " of the goal"),
            unit=unit,
            signs=signs,
            bounds=bounds,
            write=write,
            of=of,
            of_goal=True,
        )


OBSERVATION = (
    Part(
        name="goal",
        meaning="position of the goal x, y, z",
        unit="m",
        signs=POLAR,
        bounds=lambda ranges: (ranges.goal_lower, ranges.goal_upper),
        write=write_goal,
        of_goal=True,
    ),
    Part(
        name="goal_minus_tool",
        meaning="goal minus tool point x, y, z",
        unit="m",
        signs=POLAR,
        bounds=lambda ranges: (ranges.goal_lower - ranges.reach, ranges.goal_upper + ranges.reach),
        write=write_offset,
        of_goal=True,
    ),
    Part(
        name="resolved_rate",
        meaning=(
            "action of resolved-rate control: a damped Newton step from the commanded joints to "
            "the goal, blind to contact, for each actuated joint, shortened as a whole to 1 at most"
        ),
        signs=(0,),
        write=write_resolved_rate,
        of=ACTUATED,
        of_goal=True,
    ),
    Part(
        name="orientation",
        meaning="orientation of each joint frame, quaternion w, x, y, z",
        signs=(1, -1, 1, -1),
        write=_of_frames(0, 4),
        of=JOINTS,
    ),
    Part(
        name="position",
        meaning="position of each joint frame x, y, z",
        unit="m",
        signs=POLAR,
        bounds=lambda ranges: (-ranges.reach, ranges.reach),
        write=_of_frames(13, 3),
        of=JOINTS,
    ),
    Part(
        name="joint_positions",
        meaning="position of each joint",
        unit="rad or m",
        signs=(0,),
        bounds=lambda ranges: (ranges.lower, ranges.upper),
        write=_write_joints,
        of=JOINTS,
    ),
    Part(
        name="joint_angles",
        meaning="sine and cosine of each joint's angle",
        signs=(0, 1),
        write=_write_angles,
        of=JOINTS,
        lacks=_slides,
    ),
    Part(
        name="joint_velocities",
        meaning="velocity of each actuated joint in the last step, as a fraction of its limit",
        signs=(0,),
        bounds=lambda ranges: (-ranges.fastest, ranges.fastest),
        write=_write_velocities,
        of=ACTUATED,
    ),
    Part(
        name="last_action",
        meaning="last action, clipped; zeros at the start",
        signs=(0,),
        write=_write_action,
        of=ACTUATED,
    ),
    Part(
        name="commanded",
        meaning="commanded position of each joint",
        unit="rad or m",
        signs=(0,),
        bounds=lambda ranges: (ranges.lower, ranges.upper),
        write=_write_commanded,
        of=JOINTS,
    ),
    Part(
        name="time_left",
        meaning="share of the horizon that is left",
        signs=(1,),
        bounds=lambda _: (0.0, 1.0),
        write=_write_time,
    ),
    Part(
        name="proximity",
        meaning=(
            "for each joint's link, a lower bound of the distance to the nearest body, at most "
            f"{NEAR:g} m, the direction away from it x, y, z, and what the largest step of each "
            f"actuated joint adds to the distance; zeros at {NEAR:g} m"
        ),
        unit="m, 1, m",
        signs=(1, *POLAR),
        bounds=lambda ranges: (
            np.tile([0.0, *[-UNIT] * 3, *[-LARGEST] * len(ranges.fastest)], len(ranges.lower)),
            np.tile([NEAR, *[UNIT] * 3, *[LARGEST] * len(ranges.fastest)], len(ranges.lower)),
        ),
        write=write_proximity,
        of=JOINTS,
        sloped=True,
        lacks=_is_bare,
    ),
    Part(
        name="obstacles",
        meaning=(
            "for each of the bodies nearest to the tool point, a box: middle minus tool point "
            "x, y, z, half-size x, y, z, and the first two columns of its rotation; zeros for none"
        ),
        unit="m, m, 1",
        signs=(*POLAR, 1, 1, 1, *POLAR, -1, 1, -1),
        bounds=lambda _: (
            np.array([*[-LARGEST] * 3, *[0.0] * 3, *[-UNIT] * 6]),
            np.array([*[LARGEST] * 6, *[UNIT] * 6]),
        ),
        write=write_obstacles,
        of=SLOTS,
        lacks=_has_no_obstacles,
    ),
    *_rest_parts("direction", "direction x, y, z", POLAR),
    *_rest_parts("pose", "quaternion w, x, y, z", (1, -1, 1, -1)),
    *_rest_parts("configuration", "position of each joint", (0,), of=JOINTS, unit="rad or m"),
)
"""The parts in order; those per joint go through all joints in turn."""


@inlined
def _write_nothing(session: Session, seen: Seen) -> None:
    """End of the observation."""


def _compose(parts: Sequence[Part], index: int = 0) -> Any:
    """Join the formulas of parts into one kernel, inlined by Numba."""
    if index == len(parts):
        return _write_nothing
    write, write_others = parts[index].write, _compose(parts, index + 1)

    @inlined
    def write_parts(session: Session, seen: Seen) -> None:
        shown = session.rules.shown
        write(session, seen, shown[index, 0], shown[index, 1])
        write_others(session, seen)

    return write_parts


@cache
def observer(names: tuple[str, ...]) -> Stage:
    """The stage that writes some parts of a step; what was seen before moves on."""
    known = {part.name: part for part in OBSERVATION}
    write_parts = _compose([known[name] for name in names])

    def observe(session: Session, poses: Array) -> int:
        block, tool, width = session.block, session.chain.tool, session.rules.width
        for i in range(block.observation.shape[1] - 1, width - 1, -1):
            block.observation[0, i] = block.observation[0, i - width]
        frames, goal, joints = poses, block.goal, block.q
        if block.plant.shape[0] > 0:
            frames, goal, joints = block.seen_poses, block.seen_goal, block.sensed
        point = to_world(frames, joints.shape[1], tool[0], tool[1], tool[2])
        write_parts(session, Seen(poses, frames, point, goal, joints, block.former))
        return 0

    return Stage(observe, POSES, key=" ".join(names))
