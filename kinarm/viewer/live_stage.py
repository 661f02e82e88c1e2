"""A problem with a moving arm in Meshcat's own viewer."""

import time
from itertools import count

import numpy as np
import pinocchio as pin
from meshcat import Visualizer
from numpy.typing import ArrayLike, NDArray

from kinarm.arm import Arm
from kinarm.body_motion import BodyMotion
from kinarm.problem import ReachProblem
from kinarm.viewer.camera import stage_scale
from kinarm.viewer.drawing import (
    draw_arm,
    draw_goal,
    draw_random_bodies,
    draw_surroundings,
    draw_trace,
)
from kinarm.viewer.parts import goal_pose

FIELD_OF_VIEW, CAMERA_PLACE = 32, (-2.4, 1.6, 1.9)
"""From behind the arm's right [degrees, m]; in three.js, y points up."""


class LiveStage:
    """Surroundings, goal, arm and its tool's way; Meshcat's server shows them at an ``address``."""

    def __init__(self, problem: ReachProblem, arm: Arm) -> None:
        self._arm, self._data = arm, arm.model.createData()
        self._problem, self._moving = problem, dict[str, BodyMotion]()
        self._due, self._scale = 0.0, stage_scale(arm, problem.scene)
        self._window = window = Visualizer()
        window.window.ids = count()  # of what is drawn
        self.address: str = window.url()
        draw_surroundings(window, problem.scene)
        camera = window["/Cameras/default/rotated/<object>"]
        camera.set_property("fov", FIELD_OF_VIEW)
        camera.set_property("position", [self._scale * value for value in CAMERA_PLACE])
        draw_goal(window["goal"], problem)
        self._frames = draw_arm(window["arm"], arm)[1:]

    def close(self) -> None:
        """End the server."""
        viewer = self._window.window
        viewer.zmq_socket.close(linger=0)
        with viewer.server_proc as server:
            server.kill()

    def begin(self, configuration: NDArray[np.float64], goal: ArrayLike) -> None:
        """Show a start and a goal [rad or m, m], without a way."""
        self.aim(goal)
        self._window["trace"].delete()
        shown = self._window, "random", self._problem.scene, self._arm
        self._moving = draw_random_bodies(*shown, configuration, np.asarray(goal))
        self.show(configuration)

    def aim(self, goal: ArrayLike) -> None:
        """Show a goal [m]."""
        self._window["goal"].set_transform(goal_pose(self._problem.task.goal, goal))

    def show(self, configuration: NDArray[np.float64], step: int = 0) -> None:
        """Move the arm to a configuration [rad or m], and bodies to where they are after a step."""
        for path, motion in self._moving.items():
            place, seconds = np.eye(4), step * self._problem.stepping.time_step
            place[:3, 3] = motion.offsets(np.array([seconds]))[0]
            self._window[path].set_transform(place)
        pin.forwardKinematics(self._arm.model, self._data, configuration)
        for joint, frame in enumerate(self._frames, start=1):
            frame.set_transform(self._data.liMi[joint].homogeneous)

    def draw_trace(self, points: ArrayLike, outcome: str | None) -> None:
        """Show the tool's way, shape (n, 3) [m], in an outcome's colour."""
        draw_trace(self._window["trace"], np.asarray(points), outcome, self._scale)

    def pace(self, seconds: float) -> None:
        """Wait until a time has passed since the last call ended [s]."""
        time.sleep(max(self._due + seconds - time.monotonic(), 0.0))
        self._due = time.monotonic()
