"""The watchdog: when a run is to stop."""

from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from kinarm._fields import Checked
from kinarm.errors import FROM_ZERO, NOT_NEGATIVE, POSITIVE, RunStoppedError

Array = NDArray[np.float64]

WINDOW = 0.1
"""Time over which speeds are measured [s]."""

STALE = 0.25
"""Time in which readings change if the command does [s]."""

MOVED = 0.05
"""Way of a command in that time [rad or m]."""

SLACK = 0.1
"""What a measured speed may exceed its limit by [rad/s or m/s]."""


@dataclass(frozen=True, kw_only=True)
class SafeLimits(Checked):
    """What stops a run.

    Parameters
    ----------
    distance : float
        Largest distance between a joint and its command [rad or m].
    overspeed : float
        Largest speed of a joint, as a multiple of that of commands.
    acceleration : float
        Largest acceleration of a joint [rad/s^2 or m/s^2]; 0 for any.
    late : int
        Cycles in a row that may be late.
    """

    distance: float = field(default=0.3, metadata=POSITIVE)
    overspeed: float = field(default=2.0, metadata=POSITIVE)
    acceleration: float = field(default=0.0, metadata=NOT_NEGATIVE)
    late: int = field(default=2, metadata=FROM_ZERO)


class Watchdog:
    """Watches the cycles of a run.

    Parameters
    ----------
    limits : SafeLimits
        What stops it.
    joint_names : tuple of str
        Names of the joints.
    fastest : ndarray, shape (n_joints,)
        Largest speeds of commands [rad/s or m/s].
    period : float
        Duration of a cycle [s].
    """

    def __init__(
        self, limits: SafeLimits, joint_names: tuple[str, ...], fastest: Array, period: float
    ) -> None:
        self.limits, self._names, self._period = limits, joint_names, period
        self._fastest = limits.overspeed * fastest + SLACK
        self._window = max(1, round(WINDOW / period))
        self._stale = max(2, round(STALE / period))
        kept = 1 + max(2 * self._window, self._stale)
        self._read, self._told = deque[Array](maxlen=kept), deque[Array](maxlen=kept)
        self._late = 0

    def check(self, reading: Array, told: Array, late: float) -> None:
        """Take in a cycle: what is read, was commanded before, and how late it is [s].

        Raises RunStoppedError.
        """
        self._late = self._late + 1 if late > 0 else 0
        if self._late > self.limits.late:
            raise RunStoppedError(f"{self._late} cycles in a row were late, at last {late:.3f} s")
        self._refuse(np.abs(reading - told), self.limits.distance, "from its command")
        self._read.append(reading)
        self._told.append(told)
        n, k = len(self._read), self._window
        if n > k:
            speed = (reading - self._read[-1 - k]) / (k * self._period)
            self._refuse(np.abs(speed), self._fastest, "per s, too fast")
            if self.limits.acceleration and n > 2 * k:
                before = (self._read[-1 - k] - self._read[-1 - 2 * k]) / (k * self._period)
                change = np.abs(speed - before) / (k * self._period)
                self._refuse(change, self.limits.acceleration, "per s^2, too abrupt")
        if n > self._stale:
            still = all(np.array_equal(each, reading) for each in self._recent(self._read))
            if still and np.ptp(np.array(self._recent(self._told)), axis=0).max() > MOVED:
                raise RunStoppedError(f"readings have not changed for {STALE:g} s, commands have")

    def _recent(self, kept: deque[Array]) -> list[Array]:
        return list(kept)[-1 - self._stale :]

    def _refuse(self, values: Array, most: Array | float, what: str) -> None:
        beyond = values > most
        if beyond.any():
            joint = int(beyond.argmax())
            name, limit = self._names[joint], np.broadcast_to(most, values.shape)[joint]
            raise RunStoppedError(
                f"{name} is {values[joint]:.3g} {what}; at most {limit:.3g} is allowed"
            )
