"""Backends: arms that can be read and commanded, each in its own convention."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any, Protocol, Self

import numpy as np

from kinarm.errors import InvalidInputError, RunStoppedError
from kinarm.kernels.compiling import Array
from kinarm.policies.arm_policy import from_readings, to_readings
from kinarm.world import World

FAILURES = (OSError, RuntimeError)
"""What libraries of arms raise if the arm does not answer."""


class Backend(Protocol):
    """An arm that can be read and commanded; its time is real unless it says otherwise.

    Joint positions have the shape (n_joints,) [rad or m], in the arm's own
    signs and offsets. A failure is one of `FAILURES`.

    Attributes
    ----------
    joint_names : tuple of str
        Names of its joints, in order.
    rate : float or None
        Rate at which it wants commands [Hz], if any.
    """

    joint_names: tuple[str, ...]
    rate: float | None = None

    def connect(self, period: float) -> None:
        """Connect, for a command every so often [s]; nothing moves."""

    def read(self) -> Array:
        """Measured joint positions."""

    def command(self, positions: Array) -> None:
        """Send the joints to positions."""

    def stop(self) -> None:
        """Come to rest where the arm is."""

    def close(self) -> None:
        """End the connection, also an incomplete one."""

    def now(self) -> float:
        """Time of the arm [s]."""
        return time.perf_counter()

    def wait(self, until: float) -> None:
        """Wait until a time [s]."""
        time.sleep(max(until - self.now(), 0.0))


class SimulatedArm(Backend, Protocol):
    """A backend in a simulation: waiting takes no time, and moves it on in whole periods."""

    time: float
    period: float

    def now(self) -> float:
        """Simulated time [s]."""
        return self.time

    def wait(self, until: float) -> None:
        """Move on until a time [s]."""
        while self.time + 0.5 * self.period < until:
            self.advance()
            self.time += self.period

    def advance(self) -> None:
        """Move on by a period."""

    def close(self) -> None:
        """Nothing is left open."""
        return


class WiredArm:
    """A backend in the convention of the model; failures are a `RunStoppedError`.

    Parameters
    ----------
    backend : Backend
        The arm.
    world : World
        World of the model; InvalidInputError if it has other joints.
    wiring : mapping, optional
        ``sign`` and ``offset`` of each joint, as of a contract; by default the
        arm counts as the model does.
    """

    def __init__(
        self, backend: Backend, world: World, wiring: Mapping[str, Any] | None = None
    ) -> None:
        if backend.joint_names != world.arm.joint_names:
            raise InvalidInputError(
                f"the backend has the joints {', '.join(backend.joint_names)}, arm "
                f"{world.arm.name!r} has {', '.join(world.arm.joint_names)}"
            )
        self.backend, self.now = backend, backend.now
        self._wiring, self._period = wiring or {"sign": 1.0, "offset": 0.0}, 0.0

    @contextmanager
    def connected(self, rate: float) -> Iterator[Self]:
        """The arm, to be commanded at a rate [Hz]; it is at rest afterwards."""
        self._period = 1.0 / rate
        try:
            self._asked(self.backend.connect, self._period)
            try:
                yield self
            finally:
                self.stop()
        finally:
            with suppress(*FAILURES):
                self.backend.close()

    def read(self) -> Array:
        """Joint positions of the model, shape (n_joints,) [rad or m]."""
        reading = np.asarray(self._asked(self.backend.read), dtype=float)
        if reading.shape != (len(self.backend.joint_names),) or not np.isfinite(reading).all():
            raise RunStoppedError(f"lost the arm: it reads {reading.tolist()}")
        return np.asarray(from_readings(self._wiring, reading))

    def command(self, joints: Array) -> None:
        """Send joints to positions of the model, shape (n_joints,) [rad or m]."""
        self._asked(self.backend.command, np.asarray(to_readings(self._wiring, joints)))

    def wait(self, until: float) -> None:
        """Wait until a time of the arm [s]."""
        self._asked(self.backend.wait, until)

    def followed(self, commands: Array) -> Array:
        """Command joint positions, a cycle each; readings after each, shape (n, n_joints)."""
        readings = []
        for told in commands:
            self.command(told)
            self.wait(self.now() + self._period)
            readings.append(self.read())
        return np.array(readings)

    def stop(self) -> None:
        """Come to rest where the arm is, if it still answers."""
        with suppress(*FAILURES):
            self.backend.stop()

    def _asked(self, function: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return function(*arguments)
        except FAILURES as error:
            raise RunStoppedError(f"lost the arm: {error}") from error
