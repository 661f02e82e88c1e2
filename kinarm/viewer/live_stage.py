"""A problem on a live page: an arm that moves on command."""

import time

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from kinarm.arm import Arm
from kinarm.problem import ReachProblem
from kinarm.viewer.camera import stage_scale
from kinarm.viewer.drawing import aim_camera, draw_arm, draw_goal, draw_surroundings, draw_trace
from kinarm.viewer.live_server import LiveServer


class LiveStage:
    """Surroundings, goal, arm and the way of its tool on a live page."""

    def __init__(self, server: LiveServer, problem: ReachProblem, arm: Arm) -> None:
        self.server, self._arm, self._data = server, arm, arm.model.createData()
        self._due, self._scale = 0.0, stage_scale(arm, problem.scene)
        window = server.window
        draw_surroundings(window, problem.scene)
        aim_camera(window, self._scale)
        draw_goal(window["goal"], problem)
        self._frames = draw_arm(window["arm"], arm)[1:]

    def begin(self, configuration: NDArray[np.float64], goal: ArrayLike) -> None:
        """Show a start and a goal [rad or m, m], and no way yet."""
        place = np.eye(4)
        place[:3, 3] = goal
        self.server.window["goal"].set_transform(place)
        self.server.window["trace"].delete()
        self.show(configuration)

    def show(self, configuration: NDArray[np.float64]) -> None:
        """Move the arm to a configuration [rad or m]."""
        pin.forwardKinematics(self._arm.model, self._data, configuration)
        for joint, frame in enumerate(self._frames, start=1):
            frame.set_transform(self._data.liMi[joint].homogeneous)

    def draw_trace(self, points: ArrayLike, outcome: str | None) -> None:
        """Show the way of the tool, shape (n, 3) [m], in the colour of an outcome."""
        draw_trace(self.server.window["trace"], np.asarray(points), outcome, self._scale)

    def pace(self, seconds: float) -> None:
        """Wait until some time has passed since the last call was over [s]."""
        time.sleep(max(self._due + seconds - time.monotonic(), 0.0))
        self._due = time.monotonic()
