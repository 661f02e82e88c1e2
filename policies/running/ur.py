"""Arms of Universal Robots, by ``ur_rtde``. Not tried on hardware."""

from typing import Any

import numpy as np

from kinarm.errors import needed
from kinarm.kernels.compiling import Array
from kinarm.policies.running.backend import Backend

LOOKAHEAD, GAIN = 0.1, 300.0
"""Of ``servoJ``: the time over which it smooths [s], and how hard it follows."""


class URArm(Backend):
    """An arm of Universal Robots, commanded by ``servoJ``.

    Parameters
    ----------
    address : str
        Host name or IP address of its controller, in remote control.
    """

    joint_names: tuple[str, ...] = (
        *("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint"),
        *("wrist_1_joint", "wrist_2_joint", "wrist_3_joint"),
    )
    rate: float | None = 125.0

    def __init__(self, address: str) -> None:
        self.address = address
        self._control: Any = None
        self._receive: Any = None
        self._modules = [needed(f"rtde_{part}", "ur_rtde", "ur") for part in ("receive", "control")]

    def connect(self, period: float) -> None:
        """Connect to the controller, and load the program that takes commands."""
        receive, control = self._modules
        self._period = period
        self._receive = receive.RTDEReceiveInterface(self.address)
        self._control = control.RTDEControlInterface(self.address)

    def read(self) -> Array:
        """Actual joint positions."""
        receive = self._receive
        if not receive.isConnected():
            raise ConnectionError("the controller does not answer")
        if receive.isProtectiveStopped() or receive.isEmergencyStopped():
            raise ConnectionError("its controller has stopped it")
        return np.array(receive.getActualQ())

    def command(self, positions: Array) -> None:
        """Follow positions; speed and acceleration of ``servoJ`` have no effect."""
        if not self._control.servoJ(positions.tolist(), 0.0, 0.0, self._period, LOOKAHEAD, GAIN):
            raise ConnectionError("its controller refuses commands")

    def stop(self) -> None:
        """Decelerate, and end servo mode."""
        self._control.servoStop()

    def close(self) -> None:
        """End the program, and disconnect."""
        if self._control is not None:
            self._control.stopScript()
            self._control.disconnect()
        if self._receive is not None:
            self._receive.disconnect()
