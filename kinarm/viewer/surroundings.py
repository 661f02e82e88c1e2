"""The surroundings of an arm: obstacles and the cube as meshes, and sizes of what is drawn."""

from typing import NamedTuple

import numpy as np

from kinarm.scene import GoalRegion, Obstacle, Scene
from kinarm.viewer.meshes import Mesh, box

FLOOR_RADIUS, GRID_RADIUS, GRID_STEP = 12.0, 2.0, 0.25
"""Of the floor, and of the lines on it [m]."""

SLAB_THICKNESS = 0.02
"""Thickness of the slab that covers an obstacle on which goals lie [m]."""

TRACE_RADIUS = 0.0042
TRACE_SIDES = 6
FLASH_RADIUS = 0.025
"""Radius of what lights up where two bodies touch [m]."""

CUBE_CHAMFER = 0.08
"""Of the cube's edges, as a share of their length."""


class ObstacleMeshes(NamedTuple):
    """An obstacle in the world; with a slab like a bench if goals lie on it."""

    body: Mesh
    top: Mesh | None


def obstacle_meshes(obstacle: Obstacle, scene: Scene) -> ObstacleMeshes:
    """Shapes of an obstacle."""
    size, centre = obstacle.size, obstacle.centre
    if not any(_lies_on(region, obstacle, scene.cube_edge) for region in scene.goal_regions):
        plain = box(size, 0.04 * size.min())
        return ObstacleMeshes(plain.moved(centre, obstacle.rotation), None)
    top = min(SLAB_THICKNESS, size[2] / 2)
    inset = np.minimum(0.03, 0.2 * size[:2])
    slab = box((*size[:2], top), 0.2 * top).moved((0, 0, (size[2] - top) / 2))
    body = box((*size[:2] - inset, size[2] - top)).moved((0, 0, -top / 2))
    return ObstacleMeshes(*(part.moved(centre, obstacle.rotation) for part in (body, slab)))


def _lies_on(region: GoalRegion, obstacle: Obstacle, edge: float) -> bool:
    """Whether cubes with a given edge [m], centred in a region, lie on an obstacle."""
    gap = region.lower[2] - obstacle.upper[2]
    half = np.abs(obstacle.rotation) @ obstacle.size / 2
    lower, upper = obstacle.centre - half, obstacle.centre + half
    above = all(region.lower[k] < upper[k] and lower[k] < region.upper[k] for k in (0, 1))
    return above and 0 <= gap <= edge


def cube_mesh(scene: Scene) -> Mesh:
    """The cube that marks a goal, about the origin."""
    edge = scene.cube_edge or 0.01
    return box((edge, edge, edge), CUBE_CHAMFER * edge)
