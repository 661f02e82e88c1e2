"""The watchdog: when a run is to stop."""

from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from kinarm._fields import Checked
from kinarm.errors import FROM_ZERO, NOT_NEGATIVE, POSITIVE, RunStoppedError

Array = NDArray[np.float64]

WINDOW, SLACK = 0.1, 0.1
"""Time over which speeds are measured [s], and by how much they may exceed limits [per s]."""

STALE, MOVED = 0.25, 0.05
"""Time in which readings change [s] if the command moves by so much [rad or m]."""


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
        self._limits, self._names = limits, joint_names
        self._fastest = limits.overspeed * fastest + SLACK
        self._window, stale = max(1, round(WINDOW / period)), max(2, round(STALE / period))
        self._time = self._window * period
        self._read = deque[Array](maxlen=2 * self._window + 1)
        self._recent = deque[tuple[Array, Array]](maxlen=stale + 1)
        self._late = 0

    def check(self, reading: Array, told: Array, late: float) -> None:
        """Take in a cycle: what is read, was commanded before, and how late it is [s].

        Raises RunStoppedError.
        """
        self._late = self._late + 1 if late > 0 else 0
        if self._late > self._limits.late:
            raise RunStoppedError(f"{self._late} cycles in a row were late, at last {late:.3f} s")
        self._refuse(reading - told, self._limits.distance, "from its command")
        self._read.append(reading)
        if len(self._read) > self._window:
            speed = (reading - self._read[-1 - self._window]) / self._time
            self._refuse(speed, self._fastest, "per s, too fast")
            if self._limits.acceleration and len(self._read) == self._read.maxlen:
                before = (self._read[-1 - self._window] - self._read[0]) / self._time
                change = (speed - before) / self._time
                self._refuse(change, self._limits.acceleration, "per s^2, too abrupt")
        self._recent.append((reading, told))
        seen, commanded = np.ptp(np.array(self._recent), axis=0)
        full = len(self._recent) == self._recent.maxlen
        if full and commanded.max() > MOVED and not seen.any():
            raise RunStoppedError(f"readings have not changed for {STALE:g} s, commands have")

    def _refuse(self, values: Array, most: Array | float, what: str) -> None:
        beyond = np.abs(values) - most
        if (beyond > 0).any():
            joint = int(beyond.argmax())
            value = abs(values[joint])
            raise RunStoppedError(
                f"{self._names[joint]} is {value:.3g} {what}; "
                f"at most {value - beyond[joint]:.3g} is allowed"
            )
