"""The SO-101, by LeRobot 0.6: its bus and calibration. Not tried on hardware."""

from importlib import import_module
from typing import Any

import numpy as np

from kinarm.errors import InvalidInputError
from kinarm.kernels.compiling import Array
from kinarm.policies.running.backend import Backend


class SOArm(Backend):
    """A follower arm SO-101 of LeRobot; the gripper is left alone.

    LeRobot has joints in degrees from the middle of the calibrated range.

    Parameters
    ----------
    address : str
        Its serial port.
    name : str
        Name of its calibration, LeRobot's ``id``.
    """

    joint_names: tuple[str, ...] = (
        "shoulder_pan",
        "shoulder_lift",
        "elbow_flex",
        "wrist_flex",
        "wrist_roll",
    )

    def __init__(self, address: str, name: str = "kinarm") -> None:
        try:
            library = import_module("lerobot.robots.so_follower")
        except ImportError as error:
            raise InvalidInputError(
                "lerobot is not installed: pip install 'lerobot[feetech]>=0.6'"
            ) from error
        config = library.SO101FollowerConfig(
            port=address, id=name, use_degrees=True, disable_torque_on_disconnect=False
        )
        self._robot: Any = library.SO101Follower(config)
        self._name = name

    def connect(self, period: float) -> None:  # noqa: ARG002
        """Connect to the bus; the arm must be calibrated, and is held where it is."""
        self._robot.connect(calibrate=False)
        if not self._robot.is_calibrated:
            raise ConnectionError(f"run lerobot-calibrate with --robot.id={self._name}")

    def read(self) -> Array:
        """Present positions of the servos."""
        seen = self._robot.get_observation()
        return np.deg2rad([seen[f"{name}.pos"] for name in self.joint_names])

    def command(self, positions: Array) -> None:
        """Set the servos' goals."""
        goals = np.rad2deg(positions).tolist()
        named = zip(self.joint_names, goals, strict=True)
        self._robot.send_action({f"{name}.pos": goal for name, goal in named})

    def stop(self) -> None:
        """Hold the joints where they are."""
        self.command(self.read())

    def close(self) -> None:
        """Disconnect; the servos go on holding the arm."""
        if self._robot.is_connected:
            self._robot.disconnect()
