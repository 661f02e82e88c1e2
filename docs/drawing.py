"""Shaded pictures of an arm in its scene, by casting a ray per pixel: NumPy and Pinocchio only.

The visual shapes of the shipped arms and the scene are boxes, cylinders and spheres. Each of them
is the common part of a few slabs and quadrics, so a ray meets it in one interval that is found in
closed form. The examples and ``make_animation.py`` share this module.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Literal

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from kinarm import Arm, Scene

Array = NDArray[np.float64]

BENCH = (0.62, 0.67, 0.72)
FLOOR = np.array([0.90, 0.91, 0.92])
GRID = np.array([0.78, 0.80, 0.82])
CUBE = (0.80, 0.12, 0.16)
REACHED = (0.10, 0.62, 0.30)
SUN = np.array([-0.48, -0.20, 0.86]) / np.linalg.norm([-0.48, -0.20, 0.86])
SUN_RADIUS = 0.07
AMBIENT, DIFFUSE, GLOSS = 0.50, 0.56, 0.25
FAR = 1e9


@dataclass(frozen=True)
class Solid:
    """A coloured box, cylinder (about its z axis) or sphere.

    Attributes
    ----------
    kind : {"box", "cylinder", "sphere"}
    size : ndarray, shape (3,)
        Half edges; or radius, radius and half length; or three times the radius [m].
    rotation, centre : ndarray, shape (3, 3) and (3,)
        Pose in the world [m].
    colour : ndarray, shape (3,)
        Red, green and blue in 0..1.
    """

    kind: Literal["box", "cylinder", "sphere"]
    size: Array
    rotation: Array
    centre: Array
    colour: Array

    @property
    def radius(self) -> float:
        """Radius of a sphere around it [m]."""
        if self.kind == "sphere":
            return float(self.size[0])
        return float(np.linalg.norm(self.size if self.kind == "box" else self.size[1:]))

    def meet(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        """Distances at which rays enter it (`FAR` if they miss), and the normals there.

        Parameters
        ----------
        origins, directions : ndarray, shape (n, 3)
            Rays in the world; an origin of shape (3,) is shared.
        """
        o = (origins - self.centre) @ self.rotation
        d = directions @ self.rotation
        d = np.where(np.abs(d) < 1e-12, 1e-12, d)
        entry, leave = np.full(len(d), -FAR), np.full(len(d), FAR)
        normal = np.zeros_like(d)
        for axis in {"box": (0, 1, 2), "cylinder": (2,), "sphere": ()}[self.kind]:
            middle, half = -o[..., axis] / d[:, axis], self.size[axis] / np.abs(d[:, axis])
            later = middle - half > entry
            entry = np.where(later, middle - half, entry)
            leave = np.minimum(leave, middle + half)
            normal[later] = 0.0
            normal[later, axis] = -np.sign(d[later, axis])
        if self.kind != "box":
            round_axes = slice(0, 2 if self.kind == "cylinder" else 3)
            u, v = o[..., round_axes], d[:, round_axes]
            a, b = (v * v).sum(axis=-1), (u * v).sum(axis=-1)
            inside = b * b - a * ((u * u).sum(axis=-1) - self.size[0] ** 2)
            root = np.sqrt(np.maximum(inside, 0.0))
            first = np.where(inside > 0, (-b - root) / a, FAR)
            later = first > entry
            entry = np.where(later, first, entry)
            leave = np.minimum(leave, np.where(inside > 0, (-b + root) / a, -FAR))
            normal[later] = 0.0
            normal[later, round_axes] = ((u + v * first[:, None]) / self.size[0])[later]
        hit = (entry < leave) & (entry > 1e-6)
        return np.where(hit, entry, FAR), normal @ self.rotation.T


@dataclass(frozen=True)
class Camera:
    """A perspective camera.

    Attributes
    ----------
    eye, target : tuple of float
        Where it stands and what it looks at, in the world [m].
    view : float
        Vertical angle of view [deg].
    width, height : int
        Size of the picture [pixels].
    """

    eye: tuple[float, float, float] = (-2.05, -1.25, 1.55)
    target: tuple[float, float, float] = (0.03, -0.04, 0.21)
    view: float = 32.0
    width: int = 960
    height: int = 640

    @cached_property
    def _axes(self) -> Array:
        """Rows: right, up and forward in the world."""
        forward = np.subtract(self.target, self.eye)
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        return np.array([right, np.cross(right, forward), forward])

    @cached_property
    def _focal(self) -> float:
        return self.height / 2 / np.tan(np.deg2rad(self.view) / 2)

    def rays(self, samples: int) -> Array:
        """Unit directions through ``samples``² points a pixel, shape (rows, columns, 3)."""
        columns = (np.arange(self.width * samples) + 0.5) / samples - self.width / 2
        rows = self.height / 2 - (np.arange(self.height * samples) + 0.5) / samples
        x, y = np.meshgrid(columns / self._focal, rows / self._focal)
        directions = np.stack([x, y, np.ones_like(x)], axis=-1) @ self._axes
        return directions / np.linalg.norm(directions, axis=-1, keepdims=True)

    def project(self, points: ArrayLike) -> Array:
        """Pixel coordinates (column, row) of world points, shape (..., 2)."""
        local = (np.asarray(points, dtype=float) - self.eye) @ self._axes.T
        scaled = local[..., :2] / local[..., 2:] * self._focal
        return scaled * [1, -1] + [self.width / 2 - 0.5, self.height / 2 - 0.5]

    def window(self, solid: Solid, samples: int) -> tuple[slice, slice]:
        """Rows and columns of the rays that may meet a solid."""
        distance = float((solid.centre - self.eye) @ self._axes[2])
        column, row = self.project(solid.centre) * samples
        # 1.3 covers the stretch of a sphere's image towards the corners of the picture.
        extent = 1.3 * solid.radius * self._focal / max(distance - solid.radius, 0.1) * samples
        rows, columns = (
            slice(max(int(middle - extent), 0), max(int(middle + extent) + 2, 0))
            for middle in (row, column)
        )
        return rows, columns


@cache
def _visual_model(arm: Arm) -> pin.GeometryModel:
    return pin.buildGeomFromUrdf(arm.model, str(arm.urdf_path), pin.GeometryType.VISUAL)


def arm_solids(arm: Arm, configuration: ArrayLike) -> list[Solid]:
    """Visual shapes of an arm at a configuration, shape (n_axes,) [rad]."""
    geometry, data = _visual_model(arm), arm.model.createData()
    placed = geometry.createData()
    q = np.array(configuration, dtype=float)
    pin.updateGeometryPlacements(arm.model, data, geometry, placed, q)
    solids = []
    for shape, pose in zip(geometry.geometryObjects, placed.oMg, strict=True):
        kind, size = _kind_and_size(shape.geometry)
        colour = np.array(shape.meshColor[:3])
        solids.append(Solid(kind, size, pose.rotation.copy(), pose.translation.copy(), colour))
    return solids


def _kind_and_size(body: object) -> tuple[Literal["box", "cylinder", "sphere"], Array]:
    if isinstance(body, coal.Box):
        return "box", np.array(body.halfSide)
    if isinstance(body, coal.Cylinder):
        return "cylinder", np.array([body.radius, body.radius, body.halfLength])
    if isinstance(body, coal.Sphere):
        return "sphere", np.full(3, body.radius)
    raise TypeError(f"cannot draw a {type(body).__name__}")


def scene_solids(scene: Scene, goal: ArrayLike | None = None, reached: bool = False) -> list[Solid]:
    """Benches, and a cube at a goal [m]; the cube is green once it is reached."""
    solids = [
        _upright_box((bench.lower + bench.upper) / 2, (bench.upper - bench.lower) / 2, BENCH)
        for bench in scene.benches
    ]
    if goal is not None:
        half = np.full(3, scene.cube_edge / 2)
        solids.append(_upright_box(np.asarray(goal), half, REACHED if reached else CUBE))
    return solids


def _upright_box(centre: Array, half: Array, colour: Sequence[float]) -> Solid:
    return Solid("box", half, np.eye(3), centre, np.array(colour))


def render(solids: Sequence[Solid], camera: Camera, *, samples: int = 2) -> NDArray[np.uint8]:
    """Draw solids on a floor at z = 0 that fades to white.

    Parameters
    ----------
    solids : sequence of Solid
        What to draw.
    camera : Camera
        From where.
    samples : int
        Rays per pixel along each side, against jagged edges and hard shadows.

    Returns
    -------
    ndarray of uint8, shape (height, width, 3)
    """
    directions, eye = camera.rays(samples), np.array(camera.eye)
    depth = np.full(directions.shape[:2], FAR)
    falling = directions[..., 2] < -1e-6
    depth[falling] = -eye[2] / directions[falling, 2]
    normal = np.zeros_like(directions)
    normal[..., 2] = 1.0
    body = np.full(depth.shape, -1)
    for number, solid in enumerate(solids):
        window = camera.window(solid, samples)
        part = directions[window]
        distance, facing = solid.meet(eye, part.reshape(-1, 3))
        distance = distance.reshape(part.shape[:2])
        nearer = distance < depth[window]
        depth[window][nearer] = distance[nearer]
        normal[window][nearer] = facing.reshape(part.shape)[nearer]
        body[window][nearer] = number
    points = eye + depth[..., None] * directions
    colour = _shade(solids, points, normal, body, directions, samples)
    colour[_outlines(body, normal)] *= 0.72
    height, width = camera.height, camera.width
    smooth = colour.reshape(height, samples, width, samples, 3).mean(axis=(1, 3))
    return (np.clip(smooth, 0, 1) * 255 + 0.5).astype(np.uint8)


def _shade(
    solids: Sequence[Solid],
    points: Array,
    normal: Array,
    body: NDArray[np.int64],
    directions: Array,
    samples: int,
) -> Array:
    """Colours of points: sky light, sun with shadows and a little gloss."""
    floor = body < 0
    palette = np.array([solid.colour for solid in solids])
    base = np.where(floor[..., None], _floor_colour(points), palette[body])
    radius = np.linalg.norm(points[..., :2], axis=-1)
    fade = np.where(floor, np.clip((radius - 0.95) / 0.75, 0, 1), 0.0)
    lit = _sunlight(solids, points + 2e-4 * normal, samples)
    sky = AMBIENT * (0.80 + 0.20 * normal[..., 2])
    sun = lit * np.clip(normal @ SUN, 0, 1)
    halfway = SUN - directions
    halfway /= np.linalg.norm(halfway, axis=-1, keepdims=True)
    gloss = GLOSS * lit * np.clip((normal * halfway).sum(axis=-1), 0, 1) ** 40 * ~floor
    colour = base * (sky + DIFFUSE * sun)[..., None] + gloss[..., None]
    return colour + fade[..., None] * (1 - colour)


def _floor_colour(points: Array) -> Array:
    """A light floor with lines every 0.25 m."""
    cell = np.abs((points[..., :2] / 0.25 + 0.5) % 1 - 0.5) * 0.25
    on_line = (cell < 0.0022).any(axis=-1)
    return np.where(on_line[..., None], GRID, FLOOR)


def _sunlight(solids: Sequence[Solid], points: Array, samples: int) -> Array:
    """Which points see the sun, shape (rows, columns): 1, or 0 in the shade.

    The rays through a pixel look at different points of the sun, which softens shadows.
    """
    lit = np.zeros(points.shape[:2])
    for row in range(samples):
        for column in range(samples):
            number = row * samples + column
            light = _sun_point((number + 0.5) / samples**2, 2.4 * number)
            part = points[row::samples, column::samples]
            seen = _unobstructed(solids, part.reshape(-1, 3), light)
            lit[row::samples, column::samples] = seen.reshape(part.shape[:2])
    return lit


def _sun_point(share: float, angle: float) -> Array:
    """Direction to a point of the sun's disc, out to a share of its area."""
    across = np.cross(SUN, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    radius = SUN_RADIUS * np.sqrt(share)
    offset = np.cos(angle) * across + np.sin(angle) * np.cross(SUN, across)
    light = SUN + radius * offset
    return light / np.linalg.norm(light)


def _unobstructed(solids: Sequence[Solid], points: Array, light: Array) -> NDArray[np.bool_]:
    """Whether nothing lies between points, shape (n, 3), and a distant light."""
    across = np.cross(light, [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    position = points @ across
    order = np.argsort(position)
    position = position[order]
    free = np.ones(len(points), dtype=bool)
    for solid in solids:
        middle = solid.centre @ across
        strip = slice(*np.searchsorted(position, [middle - solid.radius, middle + solid.radius]))
        rows = order[strip][free[order[strip]]]
        distance, _ = solid.meet(points[rows], np.broadcast_to(light, (rows.size, 3)))
        free[rows] = distance >= FAR
    return free


def _outlines(body: NDArray[np.int64], normal: Array) -> NDArray[np.bool_]:
    """Where two bodies, or two faces of one, meet in the picture."""
    edge = np.zeros(body.shape, dtype=bool)
    for axis, inner in ((0, edge[1:]), (1, edge[:, 1:])):
        crease = (np.diff(normal, axis=axis) ** 2).sum(axis=-1) > 0.5
        inner |= crease | (np.diff(body, axis=axis) != 0)
    return edge
