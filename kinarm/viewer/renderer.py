"""Pictures of an arm at work, drawn in software: no display, graphics card or OpenGL is needed."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm._validation import finite_array, whole_number
from kinarm.collision import Contact
from kinarm.errors import UnknownNameError
from kinarm.problem import ProblemLike, ReachProblem
from kinarm.recording import OUTCOMES
from kinarm.viewer import lighting
from kinarm.viewer.camera import Camera, CameraLike
from kinarm.viewer.kernels.rasterising import draw_shadow, draw_view, transform
from kinarm.viewer.kernels.shading import BACKGROUND, paint_floor, shade
from kinarm.viewer.kernels.views import Eye, Lights, Materials, View
from kinarm.viewer.parts import (
    FLASH_RADIUS,
    OUTCOME_COLOURS,
    Finish,
    channels,
    to_linear,
)
from kinarm.viewer.triangle_scene import CUBE, TriangleScene

Array = NDArray[np.float64]

SAMPLES = np.array([(0.375, 0.125), (0.875, 0.375), (0.125, 0.625), (0.625, 0.875)])
"""Places in a pixel: no two in a row or column, so that edges of any slope are smooth."""

GRID_WIDTH = 1 / 600
"""Width of the lines on the floor, as a share of the picture's height."""

FADING = (0.2, 3.8)
"""The floor fades out between these distances, plus that of the camera from the origin [m]."""

SHADOW_DETAIL, SHADOW_SIZES = 2, (256, 2048)
"""Texels along the shadow map for each pixel along the picture, and how many there may be."""
SHADOW_REACH = 1.75
"""Half the extent of the shadow map, about the origin [m]."""

HALO_OPACITY = 0.16
FLASH_OPACITY, FLASH_SWELL = 0.55, 1.5


class Renderer:
    """Takes pictures of a problem, its arm and the way of the tool.

    Light, colours and camera are those of the replay page.

    Parameters
    ----------
    problem, width, height
        The problem, with its arm and scene; and the size of the pictures [pixels].
    camera : Camera, optional
        Where they are taken from; as the replay page does by default. A mapping of its attributes
        or a sequence of their values will do.

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
        self._materials, self._lights = _lit(self._scene.finishes, texels)
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
    ) -> NDArray[np.uint8]:
        """Take a picture.

        Parameters
        ----------
        configuration, goal : array_like, shapes (n_joints,) and (3,)
            Joint positions [rad or m], and centre of the cube [m].
        trace : array_like, shape (n, 3), optional
            Where the tool has been [m].
        outcome : {"success", "collision", "truncated"}, optional
            How the episode ended, if it has: gives the trace its colour, and lights up the cube
            on success.
        contact : Contact, optional
            What would have touched where; the bodies light up.

        Returns
        -------
        ndarray of uint8, shape (height, width, 3)
            Red, green and blue.
        """
        n_joints = self._scene.n_joints
        configuration = finite_array("configuration", configuration, (n_joints,))
        goal = finite_array("goal", goal, (3,))
        way = finite_array("trace", np.empty((0, 3)) if trace is None else trace, (None, 3))
        if outcome is not None and outcome not in OUTCOMES:
            raise UnknownNameError("outcome", outcome, OUTCOMES)
        surfaces = self._scene.surfaces(configuration, goal, way, outcome)
        everywhere = np.zeros(len(surfaces.places), dtype=np.int64)
        transform(surfaces.places, everywhere, self._projection[None], surfaces.corners)
        nearness = self._floor_nearness.copy()
        seen = np.full(nearness.shape, -1, dtype=np.int32)
        draw_view(surfaces.corners, surfaces.faces, SAMPLES, nearness, seen)
        shadowed = np.empty_like(surfaces.places)
        transform(surfaces.places, everywhere, self._lights.sunward[None], shadowed)
        self._lights.shadow.fill(-np.inf)
        draw_shadow(shadowed, surfaces.faces, self._lights.shadow)
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
        """The halo within which the goal counts as reached, and a flash at a contact."""
        halo = self.problem.task.tolerance, *channels(CUBE.colour), HALO_OPACITY, 0.0
        balls = [(*goal, *halo)]
        if contact is not None:
            size = self._scene.scale * FLASH_SWELL * FLASH_RADIUS
            flash = size, *channels(OUTCOME_COLOURS["collision"]), FLASH_OPACITY, 1.0
            balls.append((*contact.point, *flash))
        return np.array(balls)


def _lit(finishes: Sequence[Finish], texels: int) -> tuple[Materials, Lights]:
    """Finishes in the replay page's light, with an empty shadow map of some texels a side."""
    places = np.array([lighting.SUN_PLACE, lighting.FILL_PLACE])
    directions = places / np.linalg.norm(places, axis=1, keepdims=True)
    right = np.cross((0.0, 0.0, 1.0), directions[0])
    right /= np.linalg.norm(right)
    scale = texels / (2 * SHADOW_REACH)
    turn = [scale * right, scale * np.cross(directions[0], right), directions[0]]
    sun = lighting.SUN_INTENSITY * channels(lighting.SUN)
    fill = lighting.FILL_INTENSITY * channels(lighting.FILL)
    lights = Lights(
        directions=directions,
        colours=np.array([sun, fill]),
        sky=lighting.SKY_INTENSITY * channels(lighting.SKY),
        ground=lighting.SKY_INTENSITY * channels(lighting.GROUND),
        irradiance=lighting.irradiance_map(),
        sunward=np.column_stack([turn, (texels / 2, texels / 2, 0.0)]),
        shadow=np.empty((texels, texels), dtype=np.float32),
    )
    materials = Materials(
        colour=to_linear([channels(finish.colour) for finish in finishes]),
        emission=np.zeros((len(finishes), 3)),
        roughness=np.array([finish.roughness for finish in finishes]),
        metalness=np.array([finish.metalness for finish in finishes]),
        reflections=np.array([lighting.reflection_map(finish.roughness) for finish in finishes]),
    )
    return materials, lights
