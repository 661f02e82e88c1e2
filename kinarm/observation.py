"""The observation: its parts in one table, each with its formula.

A new part is a function that writes it and an entry of `OBSERVATION`. The kernels, the spaces of
the environments, the tables of the documentation and the mirror follow from it, and policies of
another layout are refused.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from kinarm.kernels.compiling import Array, Vector, inlined

VERSION = 1
"""To be raised when the meaning of a part changes, but neither its name nor its length."""


class Ranges(NamedTuple):
    """Ranges of the entries of an observation, in the problem at hand.

    Attributes
    ----------
    goal_lower, goal_upper : ndarray, shape (3,)
        Corners of a box that holds all goals, and the tolerance about them [m].
    reach : float
        Bound on the distance from the world's origin to any point of the arm [m].
    """

    goal_lower: Array
    goal_upper: Array
    reach: float


class Part(NamedTuple):
    """One part of the observation.

    Attributes
    ----------
    name : str
        Its name in layouts.
    meaning, unit : str
        What it is, for people.
    signs : tuple of int
        Per entry, the sign that the reflection y -> -y gives it; as many as it has entries.
    bounds : callable
        From `Ranges` to the lowest and the highest values of its entries.
    write : callable
        Formula; see `write_goal`.
    per_joint : bool
        Whether there is one for every joint.
    of_goal : bool
        Whether it depends on the goal.
    """

    name: str
    meaning: str
    unit: str
    signs: tuple[int, ...]
    bounds: Callable[[Ranges], tuple[Array | float, Array | float]]
    write: Callable[[Array, Vector, Array, int, int, Array, int], None]
    per_joint: bool = False
    of_goal: bool = False

    def length(self, n_joints: int) -> int:
        """Number of its entries in the observation of an arm."""
        return len(self.signs) * (n_joints if self.per_joint else 1)


@inlined
def write_goal(
    poses: Array, tool: Vector, goals: Array, e: int, k: int, observations: Array, start: int
) -> None:
    """Position of the goal.

    Parameters
    ----------
    poses : ndarray, shape (n_joints + 1, POSE)
        Forward kinematics; see `kinarm.kernels.kinematics.forward_kinematics`.
    tool : tuple of float
        The tool point in the world [m].
    goals, observations : ndarray, shape (n_episodes, 3) and (n_episodes, n_observations)
        Goal points [m], and where the part is written.
    e : int
        Episode.
    k : int
        Joint, from 1; 0 for a part that is not per joint.
    start : int
        First entry of the part.
    """
    for i in range(3):
        observations[e, start + i] = goals[e, i]


@inlined
def write_offset(
    poses: Array, tool: Vector, goals: Array, e: int, k: int, observations: Array, start: int
) -> None:
    """Goal minus tool point.

    Parameters
    ----------
    poses, tool, goals, e, k, observations, start
        As for `write_goal`.
    """
    observations[e, start] = goals[e, 0] - tool[0]
    observations[e, start + 1] = goals[e, 1] - tool[1]
    observations[e, start + 2] = goals[e, 2] - tool[2]


@inlined
def write_orientation(
    poses: Array, tool: Vector, goals: Array, e: int, k: int, observations: Array, start: int
) -> None:
    """Orientation of a joint frame.

    Parameters
    ----------
    poses, tool, goals, e, k, observations, start
        As for `write_goal`.
    """
    for i in range(4):
        observations[e, start + i] = poses[k, i]


@inlined
def write_position(
    poses: Array, tool: Vector, goals: Array, e: int, k: int, observations: Array, start: int
) -> None:
    """Position of a joint frame.

    Parameters
    ----------
    poses, tool, goals, e, k, observations, start
        As for `write_goal`.
    """
    for i in range(3):
        observations[e, start + i] = poses[k, 13 + i]


POLAR = (1, -1, 1)
"""Signs that the reflection y -> -y gives to the entries of a vector."""

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
        name="orientation",
        meaning="orientation of each joint frame, quaternion w, x, y, z",
        unit="1",
        signs=(1, -1, 1, -1),
        bounds=lambda _: (-1 - 1e-6, 1 + 1e-6),  # to within rounding
        write=write_orientation,
        per_joint=True,
    ),
    Part(
        name="position",
        meaning="position of each joint frame x, y, z",
        unit="m",
        signs=POLAR,
        bounds=lambda ranges: (-ranges.reach, ranges.reach),
        write=write_position,
        per_joint=True,
    ),
)
"""The parts in their order; those that are per joint go through all joints before the next."""


GOAL_SIDE = 1
"""Entry that tells on which side of the arm the goal lies: its y, positive on the left [m]."""


def observation_size(n_joints: int) -> int:
    """Length of the observation of an arm."""
    return sum(part.length(n_joints) for part in OBSERVATION)


def observation_layout() -> str:
    """Names and lengths of the parts, to tell whether a policy understands them."""
    parts = (f"{part.name} {len(part.signs)}{'n' * part.per_joint}" for part in OBSERVATION)
    return f"{VERSION}: {', '.join(parts)}"


def observation_signs(n_joints: int) -> Array:
    """Signs that the reflection y -> -y gives to the entries, shape (n_observations,)."""
    parts = [np.tile(part.signs, part.length(n_joints) // len(part.signs)) for part in OBSERVATION]
    return np.concatenate(parts).astype(np.float64)


def observation_bounds(ranges: Ranges, n_joints: int) -> tuple[Array, Array]:
    """Lowest and highest values of the entries, shape (n_observations,) each."""
    ends: list[list[Array]] = [[], []]
    for part in OBSERVATION:
        for end, bound in zip(ends, part.bounds(ranges), strict=True):
            once = np.broadcast_to(bound, len(part.signs))
            end.append(np.tile(once, part.length(n_joints) // len(part.signs)))
    lower, upper = (np.concatenate(end) for end in ends)
    return lower, upper


def part_slices(n_joints: int) -> dict[str, slice]:
    """Where each part lies in the observation of an arm, by its name."""
    slices, start = {}, 0
    for part in OBSERVATION:
        slices[part.name] = slice(start, start + part.length(n_joints))
        start += part.length(n_joints)
    return slices


def observation_table(n_joints: int) -> list[tuple[str, ...]]:
    """Indices, meaning and unit of each part in the observation of an arm, for people."""
    places = part_slices(n_joints)
    return [
        (f"{places[part.name].start}-{places[part.name].stop - 1}", part.meaning, part.unit)
        for part in OBSERVATION
    ]


def _compose(parts: Sequence[Part]) -> Any:
    """Join the formulas of parts into one kernel, which Numba inlines."""
    write, length, per_joint = parts[0].write, len(parts[0].signs), parts[0].per_joint
    write_others = _compose(parts[1:]) if len(parts) > 1 else _write_nothing

    @inlined
    def write_parts(
        poses: Array, tool: Vector, goals: Array, e: int, observations: Array, start: int
    ) -> None:
        if per_joint:
            for k in range(1, poses.shape[0]):
                write(poses, tool, goals, e, k, observations, start)
                start += length
        else:
            write(poses, tool, goals, e, 0, observations, start)
            start += length
        write_others(poses, tool, goals, e, observations, start)

    return write_parts


@inlined
def _write_nothing(
    poses: Array, tool: Vector, goals: Array, e: int, observations: Array, start: int
) -> None:
    """End of the observation."""


write_observation = _compose(OBSERVATION)
"""Kernel that writes a row of observations: poses, tool, goals, row, observations, first entry."""
