"""Pictures of an arm at work, in software: no display or OpenGL."""

from collections.abc import Iterable
from itertools import count

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from kinarm.arm import Arm
from kinarm.collision import Contact
from kinarm.errors import UnknownNameError, finite_array, whole_number
from kinarm.kernels.compiling import Array
from kinarm.problem import ProblemLike, ReachProblem
from kinarm.recording import OUTCOMES
from kinarm.viewer.camera import Camera, CameraLike, stage_scale
from kinarm.viewer.kernels.rasterising import Eye, Surfaces, draw_view, transform
from kinarm.viewer.kernels.shading import BACKGROUND, View, paint_floor, shade
from kinarm.viewer.lighting import SUN_DEPTH, lit
from kinarm.viewer.meshes import Mesh, tube
from kinarm.viewer.parts import (
    FLASH_RADIUS,
    OUTCOME_COLOURS,
    TRACE_RADIUS,
    TRACE_SIDES,
    TRACES,
    Finish,
    channels,
    cube_mesh,
    goal_marks,
    goal_pose,
    obstacle_meshes,
)
from kinarm.viewer.visual_shapes import arm_parts, link_joints

SAMPLES = np.array([(0.375, 0.125), (0.875, 0.375), (0.125, 0.625), (0.625, 0.875)])
"""Places in a pixel, no two in a row or column, for edges of any slope."""

MIDDLE = np.array([(0.5, 0.5)])

GRID_WIDTH = 1 / 600
"""Width of the floor's lines, as a share of the picture's height."""

FADING = (0.2, 3.8)
"""The floor fades between these, plus the camera's distance from the origin [m]."""

SHADOW_DETAIL, SHADOW_SIZES = 2, (256, 2048)
"""Texels of the shadow map per pixel, and least and most of them."""
HALO_OPACITY = 0.16
FLASH_OPACITY, FLASH_SWELL = 0.55, 1.5

# Finishes in the replay page's light; the first is the floor's.
GROUND = Finish(0xD3D9DF, roughness=0.95)
BODY = Finish(0x8F9AA8, roughness=0.8)
SLAB = Finish(0xB3BDC8, roughness=0.7)
CUBE = Finish(0x009E73, roughness=0.5)

CUBE_GLOW, TOUCH_GLOW = 0x0B6B50, 0x8C2F00
"""Light of a reached cube, and of links that touch."""


class Renderer:
    """Takes pictures of a problem, its arm and the tool's way.

    Light, colours and camera are those of the replay page.

    Parameters
    ----------
    problem, width, height
        The problem, and the size of pictures [pixels].
    camera : Camera, optional
        The camera, or its values; as on the replay page by default.

    Raises
    ------
    InvalidInputError
        If the size or the camera cannot be used.
    """

    def __init__(
        self,
        problem: ProblemLike,
        *,
        width: int = 480,
        height: int = 360,
        camera: CameraLike | None = None,
    ) -> None:
        self.problem = ReachProblem.load(problem)
        self.width = whole_number("width", width, 1)
        self.height = whole_number("height", height, 1)
        arm = self.problem.load_arm()
        self.camera = Camera.checked(camera or Camera.of_replays(self.problem, arm))
        self._scene = TriangleScene(self.problem, arm)
        self._projection = self.camera.projection(self.width, self.height)
        rays = np.linalg.inv(self._projection[:, :3]).T[[2, 0, 1]]
        position = np.array(self.camera.position)
        fog = float(np.linalg.norm(position)) + np.array(FADING)
        self._eye = Eye(position, np.ascontiguousarray(rays), SAMPLES, fog)
        texels = int(np.clip(SHADOW_DETAIL * max(self.width, self.height), *SHADOW_SIZES))
        self._materials, self._lights = lit(self._scene.finishes, texels)
        size = self.height, self.width
        self._floor = np.full((*size, 2, 3), BACKGROUND, dtype=np.float32)
        self._floor_nearness = np.zeros((*size, len(SAMPLES)), dtype=np.float32)
        if self.problem.scene.ground:
            line_width = max(GRID_WIDTH * self.height, 0.4)
            floor = self._floor, self._floor_nearness
            paint_floor(self._eye, self._materials, self._lights, line_width, *floor)

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
        """
        n_joints = self._scene.n_joints
        configuration = finite_array("configuration", configuration, (n_joints,))
        goal = finite_array("goal", goal, (self.problem.task.goal.width(n_joints),))
        way = finite_array("trace", np.empty((0, 3)) if trace is None else trace, (None, 3))
        if outcome is not None and outcome not in OUTCOMES:
            raise UnknownNameError("outcome", outcome, OUTCOMES)
        surfaces = self._scene.surfaces(configuration, goal, way, outcome, time)
        everywhere = np.zeros(len(surfaces.places), dtype=np.int64)
        transform(surfaces.places, everywhere, self._projection[None], surfaces.corners)
        nearness = self._floor_nearness.copy()
        seen = np.full(nearness.shape, -1, dtype=np.int32)
        draw_view(surfaces.corners, surfaces.faces, SAMPLES, nearness, seen)
        shadow, shadowed = self._lights.shadow, np.empty_like(surfaces.places)
        transform(surfaces.places, everywhere, self._lights.sunward[None], shadowed)
        away = 1.0 / shadowed[:, 2:].clip(1.0, 2 * SUN_DEPTH)  # as of a picture's surfaces
        corners = np.concatenate([shadowed[:, :2] * away, away], axis=1)
        shadow.fill(0.0)
        draw_view(corners, surfaces.faces, MIDDLE, shadow, np.empty(shadow.shape, np.int32))
        emission = self._scene.emission(outcome, contact.pair if contact else ())
        view = View(
            eye=self._eye,
            surfaces=surfaces,
            materials=self._materials._replace(emission=emission),
            lights=self._lights,
            balls=self._balls(goal, contact),
            floor=self._floor,
            nearness=nearness,
            seen=seen,
        )
        picture = np.empty((self.height, self.width, 3), dtype=np.uint8)
        shade(view, picture)
        return picture

    def _balls(self, goal: Array, contact: Contact | None) -> Array:
        """Halo of goals within tolerance, and a flash at a contact."""
        halo = self.problem.task.tolerance, *channels(CUBE.colour), HALO_OPACITY, 0.0
        balls = [(*goal[:3], *halo)]
        if contact is not None:
            size = self._scene.scale * FLASH_SWELL * FLASH_RADIUS
            flash = size, *channels(OUTCOME_COLOURS["collision"]), FLASH_OPACITY, 1.0
            balls.append((*contact.point, *flash))
        return np.array(balls)


class TriangleScene:
    """Surfaces of a problem and its arm, placed for each picture.

    Of its finishes by material, the floor's comes first; its scale is the `stage_scale`.
    """

    def __init__(self, problem: ReachProblem, arm: Arm) -> None:
        scene = problem.scene
        self.n_joints, self.scale = arm.n_joints, stage_scale(arm, scene)
        self._arm, self._data, self._links = arm, arm.model.createData(), link_joints(arm)
        self._goal = problem.task.goal
        placed = scene.bodies[: len(scene.obstacles)]
        self._motions = [body.motion for body in placed if body.motion]
        frames = count(self.n_joints + 2)
        standing = [
            (frame, finish, mesh)
            for body, meshes in zip(placed, obstacle_meshes(scene), strict=True)
            for frame in [next(frames) if body.motion else 0]
            for finish, mesh in zip((BODY, SLAB), meshes, strict=False)
        ]
        marks = [(CUBE, cube_mesh(scene)), *goal_marks(self._goal)]
        parts = [*standing, *arm_parts(arm), *((arm.n_joints + 1, *mark) for mark in marks)]
        self._arm_owners = {part[:2] for part in arm_parts(arm)}
        # Each frame has its own materials, so that a link can light up.
        owners = [(0, GROUND), *((0, finish) for finish in TRACES.values())]
        self._owners = list(dict.fromkeys([*owners, *(part[:2] for part in parts)]))
        self.finishes = [finish for _, finish in self._owners]
        meshes = [Mesh.joined([mesh]) for *_, mesh in parts]
        sizes = [len(mesh.vertices) for mesh in meshes]
        self._vertices, self._normals, self._faces = Mesh.joined(meshes).with_normals()
        self._frames = np.repeat([frame for frame, *_ in parts], sizes)
        self._materials = np.repeat([self._owners.index(part[:2]) for part in parts], sizes)

    def surfaces(
        self,
        configuration: Array,
        goal: Array,
        trace: Array,
        outcome: str | None,
        time: float = 0.0,
    ) -> Surfaces:
        """All triangles in the world; see `kinarm.viewer.Renderer.render`."""
        places, normals = np.empty_like(self._vertices), np.empty_like(self._normals)
        poses = self._poses(configuration, goal, time)
        transform(self._vertices, self._frames, poses, places)
        poses[:, :, 3] = 0.0
        transform(self._normals, self._frames, poses, normals)
        faces, materials = self._faces, self._materials
        if len(trace) > 1:
            way, aside, stretches = _tube(trace, self.scale * TRACE_RADIUS)
            material = self._owners.index((0, TRACES[outcome]))
            faces = np.concatenate([faces, stretches + len(places)])
            places, normals = np.concatenate([places, way]), np.concatenate([normals, aside])
            materials = np.concatenate([materials, np.full(len(way), material)])
        return Surfaces(places, normals, np.empty_like(places), faces, materials)

    def emission(self, outcome: str | None, touching: Iterable[str]) -> Array:
        """Light of each material, shape (n, 3): of a reached cube and of contact."""
        joints = {self._links[body] for body in touching if body in self._links}
        light = np.zeros((len(self._owners), 3))
        for material, (frame, finish) in enumerate(self._owners):
            if finish == CUBE and outcome == "success":
                light[material] = channels(CUBE_GLOW)
            elif frame in joints and (frame, finish) in self._arm_owners:
                light[material] = channels(TOUCH_GLOW)
        return light

    def _poses(self, configuration: Array, goal: Array, time: float) -> Array:
        """Frames in the world, shape (n_joints + 2 + n_moving, 3, 4).

        World, joints, goal, and offsets of obstacles that move.
        """
        pin.forwardKinematics(self._arm.model, self._data, configuration)
        poses = np.zeros((self.n_joints + 2 + len(self._motions), 3, 4))
        poses[:, :, :3] = np.eye(3)
        for joint in range(1, self.n_joints + 1):
            poses[joint] = self._data.oMi[joint].homogeneous[:3]
        poses[self.n_joints + 1] = goal_pose(self._goal, goal)[:3]
        for pose, motion in zip(poses[self.n_joints + 2 :], self._motions, strict=True):
            pose[:, 3] = motion.offsets(np.array([time]))[0]
        return poses


def _tube(points: Array, radius: float) -> tuple[Array, Array, NDArray[np.int64]]:
    """Vertices, normals and faces of a tube along points, shape (n, 3) [m]."""
    mesh = tube(points, radius, TRACE_SIDES)
    around = mesh.vertices[:-2].reshape(len(points), TRACE_SIDES, 3) - points[:, None]
    ends = points[[0, -1]] - points[[1, -2]]
    normals = np.concatenate([around.reshape(-1, 3), ends])
    return mesh.vertices, normals, mesh.faces
