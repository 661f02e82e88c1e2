"""Drawn parts of arms, obstacles and the cube, with finishes and colours."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm.bodies import Body, rotation_of_quaternion
from kinarm.goals import GoalSpecification, quaternion_between
from kinarm.meshes import coal_shape
from kinarm.scene import GoalRegion, Scene
from kinarm.viewer.meshes import Mesh, box, from_coal, tube

Array = NDArray[np.float64]

FLOOR_RADIUS, GRID_RADIUS, GRID_STEP = 12.0, 2.0, 0.25
"""Of the floor, and of the lines on it [m]."""

SLAB_THICKNESS = 0.02
"""Thickness of the slab on an obstacle that carries goals [m]."""

SURFACE_SIDES = 64
TRACE_RADIUS = 0.0042
TRACE_SIDES = 6
FLASH_RADIUS = 0.025
"""Radius of the flash at a contact [m]."""

CUBE_CHAMFER = 0.08
"""Of the cube's edges, as a share of their length."""

REFLECTANCE = 0.7
"""Of white lacquer; a white of 1 shows no shape in bright light."""


class Finish(NamedTuple):
    """A surface of three.js' standard material, its colour as 0xRRGGBB.

    A surface that glows shows its colour without any light.
    """

    colour: int
    roughness: float = 0.6
    metalness: float = 0.0
    opacity: float = 1.0
    glow: bool = False


class ArmPart(NamedTuple):
    """A piece of an arm in the frame of its joint; 0 is the base."""

    joint: int
    finish: Finish
    mesh: Mesh


FINISHES = {
    "paint": Finish(0xF2B21B, roughness=0.36, metalness=0.05),
    "graphite": Finish(0x2E3238, roughness=0.5, metalness=0.25),
    "steel": Finish(0xC3C9D0, roughness=0.28, metalness=0.75),
    "accent": Finish(0xE8EBEE, roughness=0.3, metalness=0.1),
}
"""Finishes of arms."""

CUBE = Finish(0x009E73, roughness=0.5)

SUN, SUN_PLACE = 0xFFF6E8, (-2.0, -1.0, 3.4)
"""Colour and place of the light that casts shadows; it shines on the origin [m]."""

PLAIN = FINISHES["graphite"], FINISHES["paint"]
"""Finishes of links by turns, for robots without colours."""

OUTCOME_COLOURS = {"success": 0x0072B2, "collision": 0xD55E00, "truncated": 0xE69F00}
"""Distinguishable with any colour vision (Okabe and Ito)."""

PAGE_COLOURS = {**OUTCOME_COLOURS, "replaced": 0xCC79A7}
"""Those of outcomes, and of steps that a shield replaced."""

TRACES: dict[str | None, Finish] = {
    None: Finish(0x4D5A68, roughness=0.5),
    **{outcome: Finish(colour, roughness=0.5) for outcome, colour in OUTCOME_COLOURS.items()},
}
"""Finish of the tool's way by outcome; None before the end."""


def shape_finish(colour: int) -> Finish:
    """Lacquer or plastic of a visual shape of a URDF, in a colour 0xRRGGBB."""
    seen = to_srgb(REFLECTANCE * to_linear(channels(colour)))
    return Finish(packed_colour(seen), roughness=0.45, metalness=0.1)


def packed_colour(colour: ArrayLike) -> int:
    """Red, green and blue from 0 to 1 as 0xRRGGBB."""
    red, green, blue = (round(255 * float(value)) for value in np.clip(np.asarray(colour), 0, 1))
    return red << 16 | green << 8 | blue


def channels(colour: int) -> Array:
    """Red, green and blue of 0xRRGGBB, from 0 to 1."""
    return np.array([colour >> 16 & 255, colour >> 8 & 255, colour & 255]) / 255.0


def to_linear(encoded: ArrayLike) -> Array:
    """Decode sRGB."""
    value = np.asarray(encoded, dtype=float)
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def to_srgb(linear: ArrayLike) -> Array:
    """Encode as sRGB."""
    value = np.asarray(linear, dtype=float)
    return np.where(
        value <= 0.0031308, 12.92 * value, 1.055 * np.maximum(value, 0) ** (1 / 2.4) - 0.055
    )


def obstacle_meshes(scene: Scene) -> list[list[Mesh]]:
    """The obstacles; a box is a bench of body and slab if goals lie on it."""
    return [_obstacle(body, scene) for body in scene.bodies[: len(scene.obstacles)]]


def _obstacle(body: Body, scene: Scene) -> list[Mesh]:
    size = np.array(body.size)
    if body.shape == "halfspace":
        parts = [_surface()]
    elif body.shape != "box":
        parts = [from_coal(coal_shape(body))]
    elif any(_lies_on(region, body, scene.cube_edge) for region in scene.goal_regions):
        top = min(SLAB_THICKNESS, size[2] / 2)
        inset = np.minimum(0.03, 0.2 * size[:2])
        below = box((*size[:2] - inset, size[2] - top)).moved((0, 0, -top / 2))
        slab = box((*size[:2], top), 0.2 * top).moved((0, 0, (size[2] - top) / 2))
        parts = [below, slab]
    else:
        parts = [box(size, 0.04 * size.min())]
    return [part.moved(body.position, body.rotation) for part in parts]


def _surface() -> Mesh:
    """Part of a half-space's plane, which is seen from outside alone."""
    angles = np.linspace(0, 2 * np.pi, SURFACE_SIDES, endpoint=False)
    around = np.stack([np.cos(angles), np.sin(angles), np.zeros(SURFACE_SIDES)], axis=1)
    rim = np.arange(1, SURFACE_SIDES + 1)
    faces = np.stack([np.zeros_like(rim), rim, np.roll(rim, -1)], axis=1)
    return Mesh(np.vstack([np.zeros(3), GRID_RADIUS * around]), faces)


def _lies_on(region: GoalRegion, body: Body, edge: float) -> bool:
    """Whether cubes of an edge [m], centred in a region, lie on an upright box."""
    half = np.abs(body.rotation) @ np.array(body.size) / 2
    lower, upper = np.array(body.position) - half, np.array(body.position) + half
    above = all(region.lower[k] < upper[k] and lower[k] < region.upper[k] for k in (0, 1))
    upright = body.rotation[2, 2] == 1.0
    return upright and above and 0 <= region.lower[2] - round(upper[2], 12) <= edge


AXES = tuple(Finish(colour, roughness=0.5) for colour in (0xC63D3D, 0x3E9C4F, 0x2F6FC4))
"""Finishes of the axes x, y and z."""

MARK_LENGTH, MARK_RADIUS = 0.12, 0.004
"""Of an axis that marks a goal's rotation [m]."""


def goal_marks(goal: GoalSpecification) -> list[tuple[Finish, Mesh]]:
    """Axes about the origin that show a goal's rotation; for a direction, z alone."""
    ends = MARK_LENGTH * np.eye(3)
    shown = {"pose": (0, 1, 2), "direction": (2,)}.get(goal.kind, ())
    return [(AXES[k], tube([0.1 * ends[k], ends[k]], MARK_RADIUS, TRACE_SIDES)) for k in shown]


def goal_pose(goal: GoalSpecification, row: ArrayLike) -> Array:
    """Where a goal and its marks are, shape (4, 4) [m]."""
    pose, given = np.eye(4), np.asarray(row, dtype=np.float64)
    pose[:3, 3], turn = given[:3], given[3:]
    if goal.kind == "direction":
        turn = quaternion_between(np.array([0.0, 0.0, 1.0]), turn)
    if goal.kind in ("direction", "pose"):
        w, x, y, z = turn.tolist()
        pose[:3, :3] = rotation_of_quaternion((w, x, y, z))
    return pose


def trace_mesh(points: Array, scale: float) -> Mesh:
    """The way of the tool through points, shape (n, 3) [m], on a stage of a scale."""
    return tube(points, scale * TRACE_RADIUS, TRACE_SIDES)


def cube_mesh(scene: Scene) -> Mesh:
    """The cube that marks a goal, about the origin."""
    edge = scene.cube_edge or 0.01
    return box((edge, edge, edge), CUBE_CHAMFER * edge)


def grid_lines() -> NDArray[np.float64]:
    """Ends of the floor's lines, which lie within a circle, shape (2 n, 3) [m]."""
    lines = []
    for across in np.arange(-GRID_RADIUS, GRID_RADIUS + 1e-9, GRID_STEP):
        half = np.sqrt(max(GRID_RADIUS**2 - across**2, 0))
        lines += [(across, -half), (across, half), (-half, across), (half, across)]
    return np.column_stack([np.array(lines), np.full(len(lines), 0.0005)])
