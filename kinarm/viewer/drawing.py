"""Draw an arm and its scene into a Meshcat window, for pages and live."""

import struct
import time
from collections.abc import Mapping
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np
import pinocchio as pin
import umsgpack
from meshcat import Visualizer, geometry
from numpy.typing import ArrayLike, NDArray

from kinarm.arm import Arm
from kinarm.body_motion import BodyMotion
from kinarm.episode_draws import scene_of_episode
from kinarm.kernels.compiling import Array
from kinarm.problem import ReachProblem
from kinarm.scene import Scene
from kinarm.viewer.camera import stage_scale
from kinarm.viewer.meshes import Mesh, capsule, cylinder
from kinarm.viewer.parts import (
    CUBE,
    FLASH_RADIUS,
    FLOOR_RADIUS,
    OUTCOME_COLOURS,
    SUN,
    SUN_PLACE,
    TRACES,
    Finish,
    cube_mesh,
    goal_marks,
    goal_pose,
    grid_lines,
    obstacle_meshes,
    trace_mesh,
)
from kinarm.viewer.visual_shapes import grouped_parts

FLOOR = Finish(0xE9ECEF, roughness=0.95)
OBSTACLE = Finish(0xB4BCC6, roughness=0.8)
GOAL_SLAB = Finish(0xCBD2DA, roughness=0.7)
HALO = Finish(0x009E73, opacity=0.16, glow=True)
FLASH = Finish(OUTCOME_COLOURS["collision"], opacity=0.5, glow=True)
GRID_COLOUR = 0xC6CCD3
BACKGROUND = [0.93, 0.945, 0.96]

FIELD_OF_VIEW, CAMERA_PLACE = 32, (-2.4, 1.6, 1.9)
"""The live camera, behind the arm's right [degrees, m]; in three.js, y points up."""

CLUTTER = ("/Axes", "/Grid", "/Lights/PointLightPositiveX", "/Lights/PointLightNegativeX")
"""Meshcat's default objects that replays do not show."""
DIMMED = {"/Lights/AmbientLight/<object>": 0.42, "/Lights/FillLight/<object>": 0.2}


class DrawnScene:
    """The commands that draw a scene on a ``window``; the same drawing gives the same bytes."""

    def __init__(self) -> None:
        self.window, self.ids, self._told = Visualizer(window=self), count(), list[bytes]()

    def send(self, command: Any) -> None:
        """Add a command behind its length; Meshcat calls this."""
        packed = umsgpack.packb(command.lower())
        self._told.append(struct.pack("<I", len(packed)) + packed)

    @property
    def content(self) -> bytes:
        """All commands."""
        return b"".join(self._told)


class _Described(geometry.Object):
    """An object in the words of three.js."""

    def __init__(self, description: Mapping[str, Any]) -> None:
        self.description = description

    def lower(self) -> Mapping[str, Any]:
        """Describe it; Meshcat calls this."""
        return self.description


class MeshStandardMaterial(geometry.GenericMaterial):
    """Three.js' standard material, which Meshcat lacks."""

    _type = "MeshStandardMaterial"


def put(window: Visualizer, finish: Finish, *meshes: Mesh) -> None:
    """Show meshes with one finish, from outside alone."""
    vertices, _, faces = Mesh.joined(meshes).with_normals()
    kind = geometry.MeshBasicMaterial if finish.glow else MeshStandardMaterial
    material = kind(
        color=finish.colour,
        opacity=finish.opacity,
        depthWrite=finish.opacity == 1,
        roughness=finish.roughness,
        metalness=finish.metalness,
        side=0,
    )
    _show(window, geometry.Mesh(geometry.TriangularMeshGeometry(vertices, faces), material))


def _show(window: Visualizer, shown: geometry.Object) -> None:
    """Show an object; names that are counted make pages the same again."""
    for part in (shown, shown.geometry, shown.material):
        part.uuid = f"id-{next(window.window.ids)}"
    window.set_object(shown)


def draw_stage(window: Visualizer, arm: Arm, problem: ReachProblem) -> None:
    """Draw surroundings, the ball at a contact, an arm and a goal.

    Parameters
    ----------
    window : meshcat.Visualizer
        Where to draw.
    arm, problem : Arm, ReachProblem
        The arm, and the problem with its surroundings and goals.
    """
    draw_surroundings(window, problem.scene)
    put(window["flash"], FLASH, capsule(0.0, stage_scale(arm, problem.scene) * FLASH_RADIUS))
    draw_arm(window["arm"], arm)
    draw_goal(window["goal"], problem)


def draw_surroundings(window: Visualizer, scene: Scene) -> None:
    """Lights, floor with a grid, and obstacles."""
    for path in CLUTTER:
        window[path].set_property("visible", False)
    for path, intensity in DIMMED.items():
        window[path].set_property("intensity", intensity)
    for end in ("top_color", "bottom_color"):
        window["/Background"].set_property(end, BACKGROUND)
    # A light from afar that casts shadows.
    own, eye = (f"id-{next(window.window.ids)}" for _ in range(2))
    sides = {"left": -1.7, "right": 1.7, "top": 1.7, "bottom": -1.7, "near": 0.5, "far": 8.0}
    shadow = {"mapSize": [2048, 2048], "bias": -0.0004, "normalBias": 0.004, "radius": 3}
    camera = {"uuid": eye, "type": "OrthographicCamera", "zoom": 1, **sides}
    light = {"uuid": own, "type": "DirectionalLight", "color": SUN, "intensity": 0.5}
    shining = {"object": {**light, "shadow": {**shadow, "camera": camera}}}
    window["sun"].set_object(_Described(shining))
    window["sun"]["<object>"].set_property("position", list(SUN_PLACE))
    if scene.ground:
        put(window["floor"], FLOOR, cylinder(0.002, FLOOR_RADIUS).moved((0, 0, -0.002)))
        lines = geometry.PointsGeometry(grid_lines().T)
        _show(window["grid"], geometry.LineSegments(lines, geometry.LineBasicMaterial(GRID_COLOUR)))
    _draw_obstacles(window["obstacles"], scene)


def draw_random_bodies(
    window: Visualizer, path: str, scene: Scene, arm: Arm, start: Array, goal: Array
) -> dict[str, BodyMotion]:
    """Draw the random bodies of an episode; return what moves, by the paths of all bodies.

    Parameters
    ----------
    window, path, scene, arm
        Where to draw, and what.
    start, goal : ndarray, shape (n_joints,) and (3,)
        Start [rad or m] and goal [m] of the episode.
    """
    fixed, places = len(scene.obstacles), {"obstacles": scene}
    if scene.random_bodies:
        window[path].delete()
        shown = scene_of_episode(scene, arm, start, goal)
        places[path] = replace(shown, obstacles=shown.obstacles[fixed:])
        _draw_obstacles(window[path], places[path])
    return {
        f"{place}/{number}": body.motion
        for place, there in places.items()
        for number, body in enumerate(there.bodies[: len(there.obstacles)])
        if body.motion
    }


def _draw_obstacles(window: Visualizer, scene: Scene) -> None:
    for number, (body, *slab) in enumerate(obstacle_meshes(scene)):
        if slab:
            put(window[f"{number}/top"], GOAL_SLAB, *slab)
        put(window[f"{number}/body"], OBSTACLE, body)


def draw_goal(window: Visualizer, problem: ReachProblem) -> None:
    """The cube, the halo of its tolerance, and axes if it has a rotation, about the origin."""
    put(window["cube"], CUBE, cube_mesh(problem.scene))
    put(window["halo"], HALO, capsule(0.0, problem.task.tolerance))
    for number, (finish, mesh) in enumerate(goal_marks(problem.task.goal)):
        put(window[f"axis_{number}"], finish, mesh)


def draw_arm(window: Visualizer, arm: Arm) -> list[Visualizer]:
    """Draw an arm as nested groups; return base and joints."""
    frames = [window]
    for number in range(1, arm.n_joints + 1):
        frames.append(frames[-1][f"axis_{number}"])
    for index, ((joint, finish), meshes) in enumerate(grouped_parts(arm).items()):
        put(frames[joint][f"part_{index}"], finish, *meshes)
    return frames


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
        if len(way := np.asarray(points)) > 1:
            put(self._window["trace"], TRACES[outcome], trace_mesh(way, self._scale))

    def pace(self, seconds: float) -> None:
        """Wait until a time has passed since the last call ended [s]."""
        time.sleep(max(self._due + seconds - time.monotonic(), 0.0))
        self._due = time.monotonic()
