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


ANGLE = {"must": "lie in [0, pi]", "holds": lambda value: 0 <= value <= math.pi}

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
    axis : tuple of float, optional
        Instead, the tool's axis lies within ``angle`` of this direction, evenly
        over the cone and turned anyhow about itself.
    angle : float
        Half of the cone's opening [rad].
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
    wander : int, optional
        Goals walk straight to the next random goal in so many steps, and on.
    """

    kind: Literal["position", "direction", "pose", "configuration"] = field(
        default="position", metadata=OPTIONAL
    )
    rotation_tolerance: float = field(default=0.1, metadata={**OPTIONAL, **POSITIVE})
    rotations: tuple[Point, ...] = field(default=(), metadata=OPTIONAL)
    axis: Point | None = None
    angle: float = field(default=0.0, metadata={**OPTIONAL, **ANGLE})
    configurations: tuple[tuple[float, ...], ...] = field(default=(), metadata=OPTIONAL)
    hold: int = field(default=1, metadata=OPTIONAL)
    speed: float | None = field(default=None, metadata=POSITIVE)
    sequence: int = field(default=1, metadata={**OPTIONAL, "at_most": 1000})
    motion: BodyMotion | None = None
    wander: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        turned, listed = self.kind in ("direction", "pose"), self.kind == "configuration"
        ways = {"motion": self.motion, "wander": self.wander, "sequence > 1": self.sequence > 1}
        given = [name for name, value in ways.items() if value]
        for wrong, reason in (
            ((self.rotations or self.axis) and not turned, f"{self.kind} has no rotations or axis"),
            (self.rotations and self.axis, "has either rotations or an axis"),
            (self.angle and not self.axis, "needs an axis for its angle"),
            (self.axis and not any(self.axis), "has an axis of 0, 0, 0"),
            (self.configurations and not listed, f"{self.kind} has no configurations"),
            (listed and (self.motion or self.wander), "configuration does not move"),
            (self.wander and len(given) > 1, f"has {' or '.join(given)}, not both"),
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
        return self.sequence > 1 or self.motion is not None or self.wander is not None

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

    def count(self, horizon: int) -> int:
        """Goals of an episode at most, 0 if it has but one that stands."""
        if self.wander is not None:
            return horizon // self.wander + 2
        return self.sequence if self.changes else 0


class Cone(NamedTuple):
    """Directions about an axis.

    Attributes
    ----------
    axis, tool_axis : ndarray, shape (3,)
        Their middle in the world, and the tool's axis in the tool frame.
    height : float
        1 less the cosine of the largest angle.
    """

    axis: Array
    tool_axis: Array
    height: float

    def turned(self, rests: Array, uniforms: Array) -> Array:
        """Tilt directions (n, 3) or quaternions (n, 4) by numbers in [0, 1), shape (n, 2 or 3).

        Quaternions are also turned about the tool's axis.
        """
        cosine = 1.0 - self.height * uniforms[:, :1]
        across = perpendicular(self.axis)
        beside = np.cross(self.axis, across)
        about = _on_circle(uniforms[:, 1])
        hinge = about[:, :1] * across + about[:, 1:] * beside
        if rests.shape[1] == 3:
            sine = np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0))
            tilted: Array = cosine * self.axis + sine * np.cross(hinge, self.axis)
            return tilted
        half = np.sqrt((1.0 + cosine) / 2), np.sqrt((1.0 - cosine) / 2)
        roll = _on_circle(0.5 * uniforms[:, 2])
        rolled = np.concatenate([roll[:, :1], roll[:, 1:] * self.tool_axis], axis=1)
        tilt = np.concatenate([half[0], half[1] * hinge], axis=1)
        return product(product(tilt, rests), rolled)


def _on_circle(shares: Array) -> Array:
    """Cosine and sine of shares of a whole turn, shape (n, 2)."""
    from kinarm.kernels.goals import circle_points  # loads Numba

    points = np.empty((2, len(shares)))
    circle_points(np.ascontiguousarray(shares), *points)
    return points.T


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
    cone : Cone, optional
        What turns the rests.
    """

    lower: Array
    extent: Array
    moving: NDArray[np.int64]
    ends: Array
    rests: Array
    cone: Cone | None = None

    @property
    def solved(self) -> bool:
        """Whether inverse kinematics gives the rests."""
        return bool(np.isnan(self.rests).any())

    @property
    def n_uniforms(self) -> int:
        """Numbers that a goal is made of."""
        turned = 0 if self.cone is None else self.rests.shape[1] - 1
        return 1 + len(self.moving) + turned + int(self.solved)

    def draw(self, rng: np.random.Generator, count: int) -> NDArray[np.float64]:
        """Draw goals, shape (count, goal_width), uniform over each region."""
        return self.at(rng.random((count, self.n_uniforms)))

    def at(self, uniforms: NDArray[np.float64]) -> NDArray[np.float64]:
        """Goals, shape (n, goal_width), of numbers in [0, 1), shape (n, n_uniforms).

        A row's first number chooses the region, and the others the place in it, and the rest.
        """
        chosen = self.ends.searchsorted(uniforms[:, 0], side="right")
        goals = np.concatenate([self.lower[chosen], self.rests[chosen]], axis=1)
        end = 1 + len(self.moving)
        goals[:, self.moving] += uniforms[:, 1:end] * self.extent[chosen]
        if self.cone is not None:
            goals[:, 3:] = self.cone.turned(goals[:, 3:], uniforms[:, end:])
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


def product(first: Array, second: Array) -> Array:
    """Products of quaternions w x y z, shape (..., 4)."""
    (aw, ax, ay, az), (bw, bx, by, bz) = np.moveaxis(first, -1, 0), np.moveaxis(second, -1, 0)
    parts = (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )
    return np.stack(parts, axis=-1)


def perpendicular(direction: Array) -> Array:
    """A direction at right angles to another."""
    least = np.eye(3)[np.abs(direction).argmin()]
    return unit(np.cross(direction, least))


def unit(vector: Array) -> Array:
    """A vector scaled to length one."""
    scaled: Array = vector / math.sqrt((vector * vector).sum())
    return scaled


def quaternion_between(first: Array, second: Array) -> Array:
    """Smallest rotation from one direction to another, as a quaternion, shape (4,)."""
    cosine = float((first * second).sum())
    if cosine < -0.999999:
        return np.concatenate([[0.0], perpendicular(first)])
    return unit(np.concatenate([[1.0 + cosine], np.cross(first, second)]))
