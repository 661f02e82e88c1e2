"""Scenes and problems with moving arms, served live to browsers."""

import sys
import threading
import time
from http.server import BaseHTTPRequestHandler
from importlib import resources
from socketserver import ThreadingTCPServer
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from kinarm.arm import Arm
from kinarm.body_motion import BodyMotion
from kinarm.errors import OutputError, whole_number
from kinarm.problem import ReachProblem
from kinarm.viewer.camera import stage_scale
from kinarm.viewer.drawing import (
    DrawnScene,
    aim_camera,
    draw_arm,
    draw_goal,
    draw_random_bodies,
    draw_surroundings,
    draw_trace,
)
from kinarm.viewer.parts import goal_pose

HOST = "127.0.0.1"
PORT, LAST_PORT = 7000, 65535

FILES = {
    "/": ("text/html; charset=utf-8", "kinarm.viewer", "live_page.html"),
    "/live_page.js": ("text/javascript", "kinarm.viewer", "live_page.js"),
    "/meshcat.js": ("text/javascript; charset=utf-8", "meshcat", "viewer/dist/main.min.js"),
    "/scene": ("application/octet-stream", "", ""),
}
"""Type, package and name of files, by address; the scene is none."""


class LiveServer(ThreadingTCPServer):
    """Serves a scene to browsers on this machine while it is drawn; for a ``with`` block.

    One draws on its ``window``. A thread answers each visitor until the process ends. The attribute
    ``port`` tells which is used, the wanted or any free one; an OutputError says if none is.
    """

    allow_reuse_address = daemon_threads = True

    def __init__(self, port: int = PORT) -> None:
        self.scene = DrawnScene()
        self.window = self.scene.window
        for wanted in (whole_number("port", port, 0, LAST_PORT), 0):
            try:
                super().__init__((HOST, wanted), _Visit)
                break
            except OSError as error:
                reason = error.strerror
        else:
            raise OutputError(f"cannot serve on port {port}: {reason}")
        self.port: int = self.server_address[1]
        threading.Thread(target=self.serve_forever, args=(0.05,), daemon=True).start()

    @property
    def address(self) -> str:
        """Address for a browser."""
        return f"http://{HOST}:{self.port}/"

    def close(self) -> None:
        """Stop serving."""
        self.shutdown()
        self.server_close()

    def __exit__(self, *_: object) -> None:
        self.close()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Connections that break are no news to a user."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class _Visit(BaseHTTPRequestHandler):
    """Answers with a file of the page, or with news of the scene, ``/scene?`` a number."""

    server: LiveServer

    def do_GET(self) -> None:
        """Answer."""
        address, _, since = self.path.partition("?")
        if address not in FILES:
            self.send_error(404)
            return
        kind, package, name = FILES[address]
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        if name:
            self.wfile.write((resources.files(package) / name).read_bytes())
        else:
            self.wfile.write(self.server.scene.news(int(since) if since.isdecimal() else 0))

    def log_message(self, *_: Any) -> None:
        """Say nothing about requests."""


class LiveStage:
    """Surroundings, goal, arm and its tool's way on a live page."""

    def __init__(self, server: LiveServer, problem: ReachProblem, arm: Arm) -> None:
        self.server, self._arm, self._data = server, arm, arm.model.createData()
        self._problem, self._moving = problem, dict[str, BodyMotion]()
        self._due, self._scale = 0.0, stage_scale(arm, problem.scene)
        window = server.window
        draw_surroundings(window, problem.scene)
        aim_camera(window, self._scale)
        draw_goal(window["goal"], problem)
        self._frames = draw_arm(window["arm"], arm)[1:]

    def begin(self, configuration: NDArray[np.float64], goal: ArrayLike) -> None:
        """Show a start and a goal [rad or m, m], without a way."""
        self.aim(goal)
        self.server.window["trace"].delete()
        shown = self.server.window, "random", self._problem.scene, self._arm
        self._moving = draw_random_bodies(*shown, configuration, np.asarray(goal))
        self.show(configuration)

    def aim(self, goal: ArrayLike) -> None:
        """Show a goal [m]."""
        self.server.window["goal"].set_transform(goal_pose(self._problem.task.goal, goal))

    def show(self, configuration: NDArray[np.float64], step: int = 0) -> None:
        """Move the arm to a configuration [rad or m], and bodies to where they are after a step."""
        for path, motion in self._moving.items():
            place, time = np.eye(4), step * self._problem.stepping.time_step
            place[:3, 3] = motion.offsets(np.array([time]))[0]
            self.server.window[path].set_transform(place)
        pin.forwardKinematics(self._arm.model, self._data, configuration)
        for joint, frame in enumerate(self._frames, start=1):
            frame.set_transform(self._data.liMi[joint].homogeneous)

    def draw_trace(self, points: ArrayLike, outcome: str | None) -> None:
        """Show the tool's way, shape (n, 3) [m], in an outcome's colour."""
        draw_trace(self.server.window["trace"], np.asarray(points), outcome, self._scale)

    def pace(self, seconds: float) -> None:
        """Wait until a time has passed since the last call ended [s]."""
        time.sleep(max(self._due + seconds - time.monotonic(), 0.0))
        self._due = time.monotonic()
