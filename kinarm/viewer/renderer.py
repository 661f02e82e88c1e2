"""Pictures of an arm at work, without a display.

Triangles are lit at their corners, about as the replay page's: by a sun, a second light from afar,
and a bright room.
"""

import math
from collections.abc import Sequence
from functools import partial
from itertools import count
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from kinarm.collision import Contact
from kinarm.errors import UnknownNameError, finite_array, whole_number
from kinarm.kernels.compiling import Array
from kinarm.problem import ProblemLike, ReachProblem
from kinarm.recording import OUTCOMES
from kinarm.viewer.camera import Camera, stage_scale
from kinarm.viewer.canvas import NEAR, Layer, draw
from kinarm.viewer.meshes import Mesh, capsule, lathe
from kinarm.viewer.parts import (
    CUBE,
    FLASH_RADIUS,
    FLOOR_RADIUS,
    OUTCOME_COLOURS,
    SUN,
    SUN_PLACE,
    TRACES,
    Finish,
    channels,
    cube_mesh,
    goal_marks,
    goal_pose,
    grid_lines,
    obstacle_meshes,
    to_linear,
    to_srgb,
    trace_mesh,
)
from kinarm.viewer.visual_shapes import grouped_parts, link_joints

single = partial(np.asarray, dtype=np.float32)

BACKGROUND = (238, 241, 244)
FLOOR, SHADOW, GRID = (235, 241, 247), (201, 207, 216), (180, 189, 199)
"""Colours of the floor, of shadows on it, and of its lines."""

GRID_WIDTH = 1 / 450
"""Width of the floor's lines, as a share of the picture's height."""

PIECES = 8
"""Of each line, since each fades from end to end."""

FADING = (0.2, 3.8)
"""The floor fades between these, plus the camera's distance from the origin [m]."""

BODY = Finish(0x8F9AA8, roughness=0.8)
SLAB = Finish(0xB3BDC8, roughness=0.7)

LIGHTS = tuple(
    (single(place) / math.hypot(*place), single(brightness))
    for place, brightness in (
        (SUN_PLACE, 0.62 * channels(SUN)),
        ((-2.5, 1.8, -2.2), 0.3 * channels(0xDCE8FF)),
    )
)
"""Directions to two lights from afar, and how bright they are."""

ROOM, SLOPE = 0.7, single([[-0.03], [0.0], [0.07]])
"""How bright the room is on the whole, and how this grows along an axis."""

HALO = (*(255 * channels(CUBE.colour)), 0.16 * 255)
FLASH = (*(255 * channels(OUTCOME_COLOURS["collision"])), 0.55 * 255)
FLASH_SWELL = 1.5

Surface = tuple[int, Finish, Mesh]
"""A frame, and what moves with it."""

CUBE_GLOW, TOUCH_GLOW = 0x0B6B50, 0x8C2F00
"""Light of a reached cube, and of links that touch."""


class Renderer:
    """Takes pictures of a problem, its arm and the tool's way.

    Colours and camera are those of the replay page. Shadows fall on the floor.

    Parameters
    ----------
    problem, width, height
        The problem, and the size of pictures [pixels].
    camera : Camera, optional
        The camera; as on the replay page by default.

    Raises
    ------
    InvalidInputError
        If the size cannot be used.
    """

    def __init__(
        self,
        problem: ProblemLike,
        *,
        width: int = 480,
        height: int = 360,
        camera: Camera | None = None,
    ) -> None:
        self.problem = ReachProblem.load(problem)
        self.width = whole_number("width", width, 1)
        self.height = whole_number("height", height, 1)
        arm, scene = self.problem.load_arm(), self.problem.scene
        self.camera = camera or Camera.of_replays(self.problem, arm)
        self._arm, self._data, self._links = arm, arm.model.createData(), link_joints(arm)
        self._scale = stage_scale(arm, scene)
        placed = scene.bodies[: len(scene.obstacles)]
        self._motions = [body.motion for body in placed if body.motion]
        frames = count(arm.n_joints + 2)
        groups = grouped_parts(arm)
        self._n_arm = len(groups)
        for finish, mesh in [(CUBE, cube_mesh(scene)), *goal_marks(self.problem.task.goal)]:
            groups[arm.n_joints + 1, finish].append(mesh)
        self._surfaces: list[Surface] = [(*key, _single(meshes)) for key, meshes in groups.items()]
        for body, meshes in zip(placed, obstacle_meshes(scene), strict=True):
            frame = next(frames) if body.motion else 0
            parts = zip((BODY, SLAB), meshes, strict=False)
            self._surfaces += [(frame, finish, _single([mesh])) for finish, mesh in parts]
        self._eye = single(self.camera.position)
        self._has_floor = scene.ground and self._eye[2] > 0
        rings = np.append(0, np.geomspace(0.5, FLOOR_RADIUS, 24))
        disc = lathe([(0.0, radius) for radius in rings])
        self._floor = self._faded(disc.vertices[disc.faces.ravel()], FLOOR)._replace(hides=True)
        self._lines = self._faded(self._grid(), GRID)

    def __repr__(self) -> str:
        return f"Renderer({self.problem.name}, {self.width} x {self.height})"

    def render(
        self,
        configuration: ArrayLike,
        goal: ArrayLike,
        *,
        trace: ArrayLike | None = None,
        outcome: str | None = None,
        contact: Contact | None = None,
        time: float = 0.0,
    ) -> NDArray[np.uint8]:
        """Take a picture.

        Parameters
        ----------
        configuration, goal : array_like, shapes (n_joints,) and (goal_width,)
            Joint positions [rad or m], and the goal, at the cube's centre [m].
        trace : array_like, shape (n, 3), optional
            Where the tool has been [m].
        outcome : {"success", "collision", "truncated"}, optional
            How the episode ended, if it has; colours trace and cube.
        contact : Contact, optional
            What would have touched; the bodies light up.
        time : float
            Since the episode began, for obstacles that move [s].

        Returns
        -------
        ndarray of uint8, shape (height, width, 3)
            Red, green and blue.

        Raises
        ------
        InvalidInputError
            If a value cannot be used.
        MissingExtraError
            If the extra ``render`` is not installed.
        """
        n_joints = self._arm.n_joints
        configuration = finite_array("configuration", configuration, (n_joints,))
        goal = finite_array("goal", goal, (self.problem.task.goal.width(n_joints),))
        way = finite_array("trace", np.empty((0, 3)) if trace is None else trace, (None, 3))
        if outcome is not None and outcome not in OUTCOMES:
            raise UnknownNameError("outcome", outcome, OUTCOMES)
        surfaces = list(self._surfaces)
        if len(way) > 1:
            surfaces.append((0, TRACES[outcome], _single([trace_mesh(way, self._scale)])))
        poses = single(self._poses(configuration, goal, time))
        drawn = self._drawn(surfaces, poses, outcome, contact)
        layers = [drawn, _ball(goal[:3], self.problem.task.tolerance, HALO)]
        if self._has_floor:
            shadow = self._faded(_on_floor(drawn.places), SHADOW)
            layers = [self._floor, shadow, self._lines, *layers]
        if contact is not None:
            size = self._scale * FLASH_SWELL * FLASH_RADIUS
            layers.append(_ball(contact.point, size, FLASH)._replace(hidden=False))
        nearest = NEAR * math.dist(self.camera.position, self.camera.target)
        projection = self.camera.projection(self.width, self.height)
        return draw(layers, (self.width, self.height), projection, nearest, BACKGROUND)

    def _drawn(
        self,
        surfaces: list[Surface],
        poses: NDArray[Any],
        outcome: str | None,
        contact: Contact | None,
    ) -> Layer:
        """Surfaces in light, with what glows."""
        touching = {self._links.get(body) for body in contact.pair} if contact else set()
        corners, colours = [], []
        for number, (frame, finish, mesh) in enumerate(surfaces):
            vertices, normals, faces = mesh.with_normals()
            turn, glow = poses[frame, :, :3].T, 0
            if finish == CUBE and outcome == "success":
                glow = CUBE_GLOW
            elif number < self._n_arm and frame in touching:
                glow = TOUCH_GLOW
            places = vertices @ turn + poses[frame, :, 3]
            colour = _lit(finish, places, normals @ turn, self._eye, single(channels(glow)))
            corners.append(places[faces.ravel()])
            colours.append(colour[faces.ravel()])
        return Layer(np.concatenate(corners), np.concatenate(colours))

    def _poses(self, configuration: Array, goal: Array, time: float) -> Array:
        """Frames in the world, shape (n_joints + 2 + n_moving, 3, 4).

        World, joints, goal, and offsets of obstacles that move.
        """
        pin.forwardKinematics(self._arm.model, self._data, configuration)
        poses = [*(frame.homogeneous for frame in self._data.oMi)]
        poses.append(goal_pose(self.problem.task.goal, goal))
        for motion in self._motions:
            poses.append(np.eye(4))
            poses[-1][:3, 3] = motion.offsets(np.array([time]))[0]
        return np.array(poses)[:, :3]

    def _faded(self, places: Array, colour: tuple[int, ...]) -> Layer:
        """Triangles on the floor, which fades into the background."""
        near, far = (float(np.linalg.norm(self._eye)) + each for each in FADING)
        distance = np.linalg.norm(places - self._eye, axis=1)
        share = np.clip((distance - near) / (far - near), 0, 1)[:, None]
        share = share**2 * (3 - 2 * share)
        shown = colour + share * (single(BACKGROUND) - colour)
        colours = np.insert(shown.astype(np.uint8), 3, 255, axis=1)
        return Layer(places, colours, hidden=False, hides=False)

    def _grid(self) -> Array:
        """The floor's lines, equally wide in the picture: corners of triangles, shape (n, 3)."""
        ends = grid_lines().reshape(-1, 2, 3)
        shares = np.linspace(0, 1, PIECES + 1)[:, None]
        points = ends[:, None, 0] + shares * (ends[:, None, 1] - ends[:, None, 0])
        aside = np.cross(ends[:, 1] - ends[:, 0], (0, 0, 1))
        aside /= np.linalg.norm(aside, axis=1, keepdims=True).clip(1e-9)
        pixel = math.tan(math.radians(self.camera.field_of_view) / 2)
        width = GRID_WIDTH * pixel * np.linalg.norm(points - self._eye, axis=2)[..., None]
        right, left = points + width * aside[:, None], points - width * aside[:, None]
        quads = [right[:, :-1], right[:, 1:], left[:, 1:]]
        quads += [right[:, :-1], left[:, 1:], left[:, :-1]]
        return np.stack(quads, axis=2).reshape(-1, 3)


def _single(meshes: Sequence[Mesh]) -> Mesh:
    """Join meshes, in single precision."""
    vertices, normals, faces = Mesh.joined(meshes).with_normals()
    return Mesh(single(vertices), faces, single(normals))


def _lit(finish: Finish, places: Array, normals: Array, eye: Array, glow: Array) -> Array:
    """Colours of a surface's points, with opacity, from 0 to 255, shape (n, 4).

    Takes points and unit normals there, shape (n, 3) [m]; and where the camera is [m], and light
    that the surface sends out, shape (3,).
    """
    colour, gloss = single(to_linear(channels(finish.colour))), 2 / finish.roughness**4
    mirror = 0.04 + (colour - 0.04) * finish.metalness
    body = colour * (1 - finish.metalness)
    view = eye - places
    view /= np.linalg.norm(view, axis=1, keepdims=True)
    mirrored = 2 * (view * normals).sum(axis=1, keepdims=True) * normals - view
    light = glow + body * _room(normals) + 0.6 * mirror * _room(mirrored)
    for towards, power in LIGHTS:
        half = view + towards
        half /= np.linalg.norm(half, axis=1, keepdims=True).clip(1e-9)
        cosine = (normals @ towards).clip(0)[:, None]
        shine = (normals * half).sum(axis=1, keepdims=True).clip(0) ** gloss * (gloss + 8) / 8
        light = light + power * cosine * (body + mirror * shine)
    encoded = 255 * to_srgb(light).clip(0, 1)
    return np.insert(encoded.astype(np.uint8), 3, 255, axis=1)


def _room(directions: Array) -> Array:
    """How bright the room is in directions, shape (n, 1)."""
    brightness: Array = ROOM + directions @ SLOPE
    return brightness


def _ball(place: ArrayLike, radius: float, colour: tuple[float, ...]) -> Layer:
    """A ball of a colour with opacity, from 0 to 255, that glows [m]."""
    mesh = capsule(0.0, radius).moved(place)
    places = mesh.vertices[mesh.faces.ravel()]
    return Layer(places, np.tile(colour, (len(places), 1)), hides=False)


def _on_floor(places: Array) -> Array:
    """Where the sun casts shadows of places onto the floor [m]."""
    x, y, z = SUN_PLACE
    height = places[:, 2].clip(0)
    return np.stack([places[:, 0] - height * x / z, places[:, 1] - height * y / z, 0 * height], 1)
