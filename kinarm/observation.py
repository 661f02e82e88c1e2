"""The observation: its parts in a table, each with its formula.

A new part is a function that writes it and an entry of `OBSERVATION`; all else follows. Policies of
another layout are refused.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kinarm.kernels.compiling import Array, Vector, inlined

VERSION = 1
"""To be raised when a part's meaning changes, but not its name and length."""


class Ranges(NamedTuple):
    """Ranges of the entries of an observation in a problem.

    A box of all goals with tolerance, and a bound on the distance from the world's origin to any
    point of the arm [m].
    """

    goal_lower: Array
    goal_upper: Array
    reach: float


class Part(NamedTuple):
    """A part of the observation.

    Attributes
    ----------
    name, meaning, unit : str
        Its name in layouts, and its meaning for people.
    signs : tuple of int
        Signs of its entries in the reflection y -> -y.
    bounds : callable
        From `Ranges` to lowest and highest values of its entries.
    write : callable
        Formula; see `write_goal`.
    per_joint, of_goal : bool
        Whether each joint has one, and whether it depends on the goal.
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
        """Number of its entries for an arm."""
        return len(self.signs) * (n_joints if self.per_joint else 1)

    def repeated(self, values: ArrayLike, n_joints: int) -> Array:
        """Values of its entries, or one for all, for every joint."""
        once = np.broadcast_to(np.asarray(values, dtype=np.float64), len(self.signs))
        return np.tile(once, self.length(n_joints) // len(self.signs))


@inlined
def write_goal(
    poses: Array, tool: Vector, goals: Array, e: int, k: int, observations: Array, start: int
) -> None:
    """Position of the goal.

    Parameters
    ----------
    poses : ndarray, shape (n_joints + 1, POSE)
        Forward kinematics; see `kinarm.kernels.kinematics.forward_kinematics`.
    tool, goals
        The tool point, and goal points, shape (n_episodes, 3), in the world
        [m].
    e, k : int
        Episode, and joint from 1; 0 if the part is not per joint.
    observations, start
        Table, shape (n_episodes, n_observations), and the part's first entry.
    """
    for i in range(3):
        observations[e, start + i] = goals[e, i]


@inlined
def _write_offset(
    poses: Array, tool: Vector, goals: Array, e: int, k: int, observations: Array, start: int
) -> None:
    """Goal minus tool point."""
    observations[e, start] = goals[e, 0] - tool[0]
    observations[e, start + 1] = goals[e, 1] - tool[1]
    observations[e, start + 2] = goals[e, 2] - tool[2]


@inlined
def _write_orientation(
    poses: Array, tool: Vector, goals: Array, e: int, k: int, observations: Array, start: int
) -> None:
    """Orientation of a joint frame."""
    for i in range(4):
        observations[e, start + i] = poses[k, i]


@inlined
def _write_position(
    poses: Array, tool: Vector, goals: Array, e: int, k: int, observations: Array, start: int
) -> None:
    """Position of a joint frame."""
    for i in range(3):
        observations[e, start + i] = poses[k, 13 + i]


POLAR = (1, -1, 1)
"""Signs of a vector in the reflection y -> -y."""

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
        write=_write_offset,
        of_goal=True,
    ),
    Part(
        name="orientation",
        meaning="orientation of each joint frame, quaternion w, x, y, z",
        unit="1",
        signs=(1, -1, 1, -1),
        bounds=lambda _: (-1 - 1e-6, 1 + 1e-6),  # to within rounding
        write=_write_orientation,
        per_joint=True,
    ),
    Part(
        name="position",
        meaning="position of each joint frame x, y, z",
        unit="m",
        signs=POLAR,
        bounds=lambda ranges: (-ranges.reach, ranges.reach),
        write=_write_position,
        per_joint=True,
    ),
)
"""The parts in order; those per joint go through all joints in turn."""


GOAL_SIDE = 1
"""Entry of the goal's y, which is positive on the left [m]."""


def observation_size(n_joints: int) -> int:
    """Length of an arm's observation."""
    return sum(part.length(n_joints) for part in OBSERVATION)


def observation_layout() -> str:
    """Names and lengths of the parts, to compare."""
    parts = (f"{part.name} {len(part.signs)}{'n' * part.per_joint}" for part in OBSERVATION)
    return f"{VERSION}: {', '.join(parts)}"


def observation_signs(n_joints: int) -> Array:
    """Signs of entries in the reflection y -> -y, shape (n_observations,)."""
    return np.concatenate([part.repeated(part.signs, n_joints) for part in OBSERVATION])


def observation_bounds(ranges: Ranges, n_joints: int) -> tuple[Array, Array]:
    """Lowest and highest values of the entries, shape (n_observations,) each."""
    bounds = [(part, part.bounds(ranges)) for part in OBSERVATION]
    lower, upper = (
        np.concatenate([part.repeated(each[end], n_joints) for part, each in bounds])
        for end in (0, 1)
    )
    return lower, upper


def part_slices(n_joints: int) -> dict[str, slice]:
    """Place of each part in an arm's observation, by name."""
    ends = np.cumsum([part.length(n_joints) for part in OBSERVATION]).tolist()
    return {
        part.name: slice(end - part.length(n_joints), end)
        for part, end in zip(OBSERVATION, ends, strict=True)
    }


def _compose(parts: Sequence[Part]) -> Any:
    """Join the formulas of parts into one kernel, inlined by Numba."""
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
"""Kernel that writes a row of observations, from its first entry."""
