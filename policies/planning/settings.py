"""Settings of plans: what starts and goals are, the margin, and limits of the motion."""

from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm._fields import Checked
from kinarm.errors import FROM_ZERO, NOT_NEGATIVE, POSITIVE, POSITIVE_SHARE, InvalidInputError

Array = NDArray[np.float64]

TO_FULL_SPEED, TO_FULL_ACCELERATION = 0.5, 0.1
"""Times in which an arm would reach its speed and acceleration, if nothing else is said [s]."""

Kind = Literal["configuration", "position", "direction", "pose"]
PARTS = {"position": 3, "direction": 6, "pose": 6}
"""Numbers of starts and goals that are no configurations."""


class Limits(NamedTuple):
    """Limits of each joint, shape (n_joints,): [rad/s], [rad/s^2] and [rad/s^3], or [m/...]."""

    velocity: Array
    acceleration: Array
    jerk: Array

    def along(self, direction: Array) -> tuple[float, float]:
        """Limits of acceleration and jerk along a direction, in units of it."""
        moved = np.abs(direction)
        shares = np.fmax(moved, 1e-12)
        return float((self.acceleration / shares).min()), float((self.jerk / shares).min())


@dataclass(frozen=True, kw_only=True)
class PlanSettings(Checked):
    """What a plan is to keep, and how it is sought.

    Parameters
    ----------
    start_kind, goal_kind : {"configuration", "position", "direction", "pose"}
        What its start, or goal, is: the position of each joint [rad or m]; or
        three numbers, the position of the tool [m], after which come three
        of the direction of its axis, or roll, pitch and yaw of its frame [rad].
    margin : float
        Distance that all tested pairs of bodies keep [m].
    speed : float
        Share of the velocity limits that is used.
    acceleration, jerk : tuple of float
        Limits of each joint, or one of all [rad/s^2, rad/s^3, or m].
    samples, seed : int
        Samples after which no path is found, if no straight one is; their seed.
    """

    start_kind: Kind = "configuration"
    goal_kind: Kind = "configuration"
    margin: float = field(default=0.0, metadata=NOT_NEGATIVE)
    speed: float = field(default=1.0, metadata=POSITIVE_SHARE)
    acceleration: tuple[float, ...] = field(default=(), metadata=POSITIVE)
    jerk: tuple[float, ...] = field(default=(), metadata=POSITIVE)
    samples: int = field(default=20_000, metadata=FROM_ZERO)
    seed: int = field(default=0, metadata=FROM_ZERO)

    def limits(self, velocity_limits: Array) -> Limits:
        """Limits of joints with these velocity limits, shape (n_joints,)."""
        found, times = [self.speed * velocity_limits], (TO_FULL_SPEED, TO_FULL_ACCELERATION)
        for name, time in zip(("acceleration", "jerk"), times, strict=True):
            limit = np.array(getattr(self, name) or found[-1] / time)
            if len(limit) not in (1, len(velocity_limits)):
                raise InvalidInputError(
                    f"{name} must be one number or {len(velocity_limits)}, got {len(limit)}"
                )
            found.append(np.broadcast_to(limit, velocity_limits.shape).copy())
        return Limits(*found)
