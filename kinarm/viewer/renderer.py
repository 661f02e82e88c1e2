"""Pictures of an arm at work, drawn in software: no display, graphics card or OpenGL is needed."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm._validation import finite_array
from kinarm.collision import Contact
from kinarm.errors import UnknownNameError
from kinarm.problem import ProblemLike, ReachProblem
from kinarm.recording import OUTCOMES
from kinarm.viewer import lighting
from kinarm.viewer.camera import Camera, CameraLike, picture_size
from kinarm.viewer.kernels.rasterising import draw_shadow, draw_view, project
from kinarm.viewer.kernels.shading import paint_floor, shade
from kinarm.viewer.kernels.views import Backdrop, Balls, Eye, Lights, Materials, Surfaces, View
from kinarm.viewer.parts import OUTCOME_COLOURS, Finish, channels, to_linear, to_srgb
from kinarm.viewer.surroundings import FLASH_RADIUS, FLOOR_RADIUS, GRID_RADIUS, GRID_STEP
from kinarm.viewer.triangle_scene import CUBE, TriangleScene

Array = NDArray[np.float64]

SAMPLES = np.array([(0.375, 0.125), (0.875, 0.375), (0.125, 0.625), (0.625, 0.875)])
"""Places in a pixel: no two in a row or column, so that edges of any slope are smooth."""

BACKGROUND, GRID_COLOUR = 0xEEF1F4, 0xB4BDC7
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

GAMMA = to_srgb(np.linspace(0, 1, 4096))


class Renderer:
    """Takes pictures of a problem, its arm and the way of the tool.

    Light, colours and camera are those of the replay page.

    Parameters
    ----------
    problem : ReachProblem, str or Path
        The problem, with its arm and scene.
    width, height : int
        Size of the pictures [pixels].
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
        self.width, self.height = picture_size(width, height)
        if camera is not None:
            camera = Camera.checked(camera)
        arm = self.problem.load_arm()
        self.camera = camera or Camera.of_replays(self.problem, arm)
        self._scene = TriangleScene(self.problem, arm)
        self._projection = self.camera.projection(self.width, self.height)
        self._eye = self._make_eye()
        self._backdrop = self._make_backdrop()
        self._materials = _materials(self._scene.finishes)
        texels = SHADOW_DETAIL * max(self.width, self.height)
        self._lights = _lights(self._scene.finishes, int(np.clip(texels, *SHADOW_SIZES)))
        self._floor = np.empty((self.height, self.width, 2, 3), dtype=np.float32)
        paint_floor(self._eye, self._materials, self._lights, self._backdrop, self._floor)
        self._floor_nearness = self._make_floor_nearness()
        shape = (self.height, self.width, len(SAMPLES))
        self._nearness = np.empty(shape, dtype=np.float32)
        self._index = np.empty(shape, dtype=np.int32)

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
        configuration : array_like, shape (n_joints,)
            Joint positions [rad or m].
        goal : array_like, shape (3,)
            Centre of the cube [m].
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

        Raises
        ------
        InvalidInputError
            If a shape or an entry cannot be used, or there is no such outcome.
        """
        n_joints = self._scene.n_joints
        configuration = finite_array("configuration", configuration, (n_joints,))
        goal = finite_array("goal", goal, (3,))
        way = finite_array("trace", np.empty((0, 3)) if trace is None else trace, (None, 3))
        if outcome is not None and outcome not in OUTCOMES:
            raise UnknownNameError("outcome", outcome, OUTCOMES)
        surfaces = self._scene.surfaces(configuration, goal, way, outcome)
        self._draw_view(surfaces)
        self._draw_shadow(surfaces.places, surfaces.faces)
        emission = self._scene.emission(outcome, contact.pair if contact else ())
        picture = np.empty((self.height, self.width, 3), dtype=np.uint8)
        view = View(
            eye=self._eye,
            surfaces=surfaces,
            materials=self._materials._replace(emission=emission),
            lights=self._lights,
            backdrop=self._backdrop,
            balls=self._balls(goal, contact),
            floor=self._floor,
            nearness=self._nearness,
            seen=self._index,
        )
        shade(view, picture)
        return picture

    def _draw_view(self, surfaces: Surfaces) -> None:
        """Find the visible surfaces."""
        project(surfaces.places, self._projection, surfaces.corners)
        np.copyto(self._nearness, self._floor_nearness)
        self._index.fill(-1)
        draw_view(surfaces.corners, surfaces.faces, SAMPLES, self._nearness, self._index)

    def _draw_shadow(self, places: Array, faces: NDArray[np.int64]) -> None:
        """Renew the shadow map."""
        shadowed = np.empty_like(places)
        project(places, self._lights.sunward, shadowed)
        self._lights.shadow.fill(-np.inf)
        draw_shadow(shadowed, faces, self._lights.shadow)

    def _balls(self, goal: Array, contact: Contact | None) -> Balls:
        """The halo within which the goal counts as reached, and a flash at a contact."""
        balls = [(goal, self.problem.task.tolerance, CUBE.colour, HALO_OPACITY, False)]
        if contact is not None:
            size = self._scene.scale * FLASH_SWELL * FLASH_RADIUS
            flash = (contact.point, size, OUTCOME_COLOURS["collision"])
            balls.append((*flash, FLASH_OPACITY, True))
        centres, radii, colours, opacities, on_top = zip(*balls, strict=True)
        encoded = [channels(colour) for colour in colours]
        return Balls(*(np.array(each) for each in (centres, radii, encoded, opacities, on_top)))

    def _make_eye(self) -> Eye:
        turned = np.linalg.inv(self._projection[:, :3])
        rays = np.ascontiguousarray(turned.T[[2, 0, 1]])
        return Eye(np.array(self.camera.position), rays, SAMPLES)

    def _make_backdrop(self) -> Backdrop:
        away = float(np.linalg.norm(self.camera.position))
        return Backdrop(
            colour=channels(BACKGROUND),
            grid=channels(GRID_COLOUR),
            fog=away + np.array(FADING),
            floor_radius=FLOOR_RADIUS if self.problem.scene.ground else 0.0,
            grid_radius=GRID_RADIUS,
            grid_step=GRID_STEP,
            line_width=max(GRID_WIDTH * self.height, 0.4),
            gamma=GAMMA,
        )

    def _make_floor_nearness(self) -> NDArray[np.float32]:
        """Inverse distance of the floor at all samples, 0 where it is not seen."""
        x = np.arange(self.width)[:, None] + SAMPLES[:, 0]
        y = (np.arange(self.height)[:, None] + SAMPLES[:, 1])[:, None]
        start, per_column, per_row = self._eye.rays[:, 2]
        fall = -(start + x * per_column + y * per_row)
        nearness = fall / max(self.camera.position[2], 1e-6)
        seen = (nearness > 0) & (self.camera.position[2] > 0) & self.problem.scene.ground
        return np.where(seen, nearness, 0).astype(np.float32)


def _materials(finishes: Sequence[Finish]) -> Materials:
    """Finishes as the kernels need them."""
    roughness = [finish.roughness for finish in finishes]
    known = sorted(set(roughness))
    return Materials(
        colour=to_linear([channels(finish.colour) for finish in finishes]),
        emission=np.zeros((len(finishes), 3)),
        roughness=np.array(roughness),
        metalness=np.array([finish.metalness for finish in finishes]),
        room=np.array([known.index(value) for value in roughness]),
    )


def _lights(finishes: Sequence[Finish], texels: int) -> Lights:
    """The replay page's light for some finishes, with an empty shadow map."""
    places = np.array([lighting.SUN_PLACE, lighting.FILL_PLACE])
    directions = places / np.linalg.norm(places, axis=1, keepdims=True)
    sun = lighting.SUN_INTENSITY * channels(lighting.SUN)
    fill = lighting.FILL_INTENSITY * channels(lighting.FILL)
    known = sorted({finish.roughness for finish in finishes})
    return Lights(
        directions=directions,
        colours=np.array([sun, fill]),
        sky=lighting.SKY_INTENSITY * channels(lighting.SKY),
        ground=lighting.SKY_INTENSITY * channels(lighting.GROUND),
        irradiance=lighting.irradiance_map(),
        reflections=np.array([lighting.reflection_map(roughness) for roughness in known]),
        sunward=_sunward(directions[0], texels),
        shadow=np.empty((texels, texels), dtype=np.float32),
    )


def _sunward(sun: Array, texels: int) -> Array:
    """World to shadow map: column, row, and how near the sun [m]; shape (3, 4)."""
    right = np.cross((0.0, 0.0, 1.0), sun)
    right /= np.linalg.norm(right)
    scale = texels / (2 * SHADOW_REACH)
    turn = np.array([scale * right, scale * np.cross(sun, right), sun])
    return np.column_stack([turn, (texels / 2, texels / 2, 0.0)])
