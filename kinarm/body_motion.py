"""How bodies of a scene move, as functions of the time since an episode began."""

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from kinarm._fields import OPTIONAL, Checked
from kinarm.errors import ProblemError

FARTHEST, FASTEST = 1e4, 100.0
"""Largest entries of offsets and velocities [m and m/s]."""


@dataclass(frozen=True, kw_only=True)
class BodyMotion(Checked):
    """Straight motions of a body, away from where it is when an episode begins.

    Parameters
    ----------
    velocity : tuple of float
        Constant velocity [m/s], instead of waypoints.
    waypoints : tuple of tuple of float
        Times [s] and offsets x, y and z [m] from its first position. Between
        them it moves straight and evenly, and after the last it rests.
    periodic : bool
        Begin anew at the last waypoint, whose offset must be zero.
    """

    velocity: tuple[float, float, float] = field(default=(0.0, 0.0, 0.0), metadata=OPTIONAL)
    waypoints: tuple[tuple[float, float, float, float], ...] = field(default=(), metadata=OPTIONAL)
    periodic: bool = field(default=False, metadata=OPTIONAL)

    def __post_init__(self) -> None:
        super().__post_init__()
        if bool(self.waypoints) == any(self.velocity):
            raise ProblemError("a motion has either a velocity or waypoints")
        if self.periodic and (not self.waypoints or any(self.waypoints[-1][1:])):
            raise ProblemError("a periodic motion ends where it begins: at an offset of 0, 0, 0")
        times = [0.0, *(time for time, *_ in self.waypoints)]
        if any(later <= time for time, later in pairwise(times)):
            raise ProblemError(f"times of waypoints must rise from above 0 s, got {times[1:]}")
        offsets = [part for _, *offset in self.waypoints for part in offset]
        if max(map(abs, offsets), default=0.0) > FARTHEST or max(map(abs, self.velocity)) > FASTEST:
            most = f"{FARTHEST:g} m, and velocities {FASTEST:g} m/s"
            raise ProblemError(f"offsets of a motion must be at most {most}")

    def reflected(self, signs: tuple[float, float, float]) -> "BodyMotion":
        """The same motion, with these signs of x, y and z."""
        sx, sy, sz = signs
        x, y, z = self.velocity
        ways = tuple((time, sx * x, sy * y, sz * z) for time, x, y, z in self.waypoints)
        return replace(self, velocity=(sx * x, sy * y, sz * z), waypoints=ways)

    def offsets(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where it is at times [s], less where it was at first, shape (n, 3) [m]."""
        if not self.waypoints:
            return np.array(self.velocity) * times[:, None]
        ways = np.array([(0.0, 0.0, 0.0, 0.0), *self.waypoints])
        if self.periodic:
            times = np.fmod(times, ways[-1, 0])
        ends = np.searchsorted(ways[:-1, 0], times, side="right")
        before, after = ways[ends - 1], ways[ends]
        share = np.fmin((times - before[:, 0]) / (after - before)[:, 0], 1.0)
        offsets: NDArray[np.float64] = before[:, 1:] + share[:, None] * (after - before)[:, 1:]
        return offsets
