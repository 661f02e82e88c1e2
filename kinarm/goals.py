"""Goals: what is to be reached, and how; and where goals lie.

A goal is a row of numbers: the position of the tool point, and a rest. The rest is nothing, a
direction of the tool's axis, a quaternion w x y z of the tool frame, or a configuration.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm._fields import OPTIONAL, Checked
from kinarm.body_motion import BodyMotion
from kinarm.errors import POSITIVE, ProblemError

KINDS = ("position", "direction", "pose", "configuration")
"""Kinds of goals, by their numbers in `kinarm.kernels.goals`."""

REST_PARTS = {
    "direction": ("goal_direction", "direction_error"),
    "pose": ("goal_rotation", "rotation_error"),
    "configuration": ("goal_joints", "joints_error"),
}
"""Parts of the rests of goals, and of their errors, by the kind of the goals."""

GOAL_RESTS, REST_ERRORS = zip(*REST_PARTS.values(), strict=True)

Point = tuple[float, float, float]
Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class GoalSpecification(Checked):
    """What is to be reached, and how. By default it is a point, reached once touched.

    Parameters
    ----------
    kind : {"position", "direction", "pose", "configuration"}
        The tool point's position; with it, the direction of the tool's axis or
        the rotation of the tool frame; or the position of every joint.
    rotation_tolerance : float
        A goal counts as reached if the direction, the rotation or each joint is
        wrong by this at most [rad, or m for a sliding joint].
    rotations : tuple
        Rotations of the tool frame, each as likely, as roll, pitch and yaw
        about fixed axes [rad]. By default a rotation is one that inverse
        kinematics finds at the position, free of contact.
    configurations : tuple
        Configurations to be reached, each as likely, instead of those that
        inverse kinematics finds in the goal regions [rad or m].
    hold : int
        Steps in a row that the tool has to stay within the tolerances.
    speed : float, optional
        Largest speed of the tool in those steps [m/s].
    sequence : int
        Goals of an episode: after one is reached, the next appears.
    motion : BodyMotion, optional
        How goals move.
    """

    kind: Literal["position", "direction", "pose", "configuration"] = field(
        default="position", metadata=OPTIONAL
    )
    rotation_tolerance: float = field(default=0.1, metadata={**OPTIONAL, **POSITIVE})
    rotations: tuple[Point, ...] = field(default=(), metadata=OPTIONAL)
    configurations: tuple[tuple[float, ...], ...] = field(default=(), metadata=OPTIONAL)
    hold: int = field(default=1, metadata={**OPTIONAL, "at_most": 1_000_000})
    speed: float | None = field(default=None, metadata=POSITIVE)
    sequence: int = field(default=1, metadata={**OPTIONAL, "at_most": 1000})
    motion: BodyMotion | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        turned, listed = self.kind in ("direction", "pose"), self.kind == "configuration"
        for wrong, reason in (
            (self.rotations and not turned, f"{self.kind} has no rotations"),
            (self.configurations and not listed, f"{self.kind} has no configurations"),
            (listed and self.motion, "configuration does not move"),
            (
                self.sequence > 1 and len(set(self.configurations)) == 1,
                f"sequence of {self.sequence} needs two configurations or more",
            ),
        ):
            if wrong:
                raise ProblemError(f"a goal {reason}")

    @cached_property
    def number(self) -> int:
        """Number of the kind."""
        return KINDS.index(self.kind)

    @property
    def changes(self) -> bool:
        """Whether goals move or follow each other."""
        return self.sequence > 1 or self.motion is not None

    @cached_property
    def plain(self) -> bool:
        """Whether it is a standing point that is reached once touched."""
        arriving = self.hold > 1 or self.speed is not None
        return self.kind == "position" and not arriving and not self.changes

    @cached_property
    def told(self) -> tuple[str, ...]:
        """Names of what episodes tell beside the distance, ``turn`` and ``goals_reached``."""
        several = ("goals_reached",) if self.sequence > 1 else ()
        return ("turn", *several) if self.number else several

    def width(self, n_joints: int) -> int:
        """Length of a goal."""
        return 3 + (0, 3, 4, n_joints)[self.number]

    @property
    def count(self) -> int:
        """Goals of an episode, 0 if it has but one that stands."""
        return self.sequence if self.changes else 0


class Goals(NamedTuple):
    """Where goals lie.

    Attributes
    ----------
    lower : ndarray, shape (n_regions, 3)
        Lower corners of the regions [m].
    extent : ndarray, shape (n_regions, n_moving)
        Their edges along `moving` [m].
    moving : ndarray of int, shape (n_moving,)
        Axes along which any region has an edge.
    ends : ndarray, shape (n_regions - 1,)
        Ends of the regions' shares in [0, 1).
    rests : ndarray, shape (n_regions, n_rest)
        Rests of goals there; NaN where inverse kinematics gives them.
    """

    lower: Array
    extent: Array
    moving: NDArray[np.int64]
    ends: Array
    rests: Array

    @property
    def solved(self) -> bool:
        """Whether inverse kinematics gives the rests."""
        return bool(np.isnan(self.rests).any())

    @property
    def n_uniforms(self) -> int:
        """Numbers that a goal is made of."""
        return 1 + len(self.moving) + int(self.solved)

    def draw(self, rng: np.random.Generator, count: int) -> NDArray[np.float64]:
        """Draw goals, shape (count, goal_width), uniform over each region."""
        return self.at(rng.random((count, self.n_uniforms)))

    def at(self, uniforms: NDArray[np.float64]) -> NDArray[np.float64]:
        """Goals, shape (n, goal_width), of numbers in [0, 1), shape (n, n_uniforms).

        A row's first number chooses the region, and the others the place in it, and the rest.
        """
        chosen = self.ends.searchsorted(uniforms[:, 0], side="right")
        goals = np.concatenate([self.lower[chosen], self.rests[chosen]], axis=1)
        goals[:, self.moving] += uniforms[:, 1 : 1 + len(self.moving)] * self.extent[chosen]
        return goals

    def with_rests(self, rests: Array) -> "Goals":
        """The same regions with each of these rests, shape (k, n_rest), in each."""
        n, k = len(self.lower), len(rests)
        shares = np.diff(np.concatenate([[0.0], self.ends, [1.0]]))
        return self._replace(
            lower=np.repeat(self.lower, k, axis=0),
            extent=np.repeat(self.extent, k, axis=0),
            ends=np.cumsum(np.repeat(shares / k, k))[:-1] if k > 1 else self.ends,
            rests=np.tile(rests, (n, 1)),
        )


def unit(vector: Array) -> Array:
    """A vector scaled to length one."""
    return vector / math.sqrt((vector * vector).sum())


def quaternion_between(first: Array, second: Array) -> Array:
    """Smallest rotation from one direction to another, as a quaternion, shape (4,)."""
    cosine = float((first * second).sum())
    if cosine < -0.999999:  # half a turn about any axis at right angles
        least = np.eye(3)[np.abs(first).argmin()]
        return np.concatenate([[0.0], unit(np.cross(first, least))])
    return unit(np.concatenate([[1.0 + cosine], np.cross(first, second)]))
