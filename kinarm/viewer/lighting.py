"""Light on a stage, as on the replay page: sun, fill, sky, and a bright room that is reflected."""

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from kinarm.viewer.kernels.lighting import Lights, Materials
from kinarm.viewer.parts import Finish, channels, to_linear

Array = NDArray[np.float64]

SUN_PLACE = (-2.0, -1.0, 3.4)
FILL_PLACE = (-2.5, 1.8, -2.2)
"""Places of the lights, which shine on the origin from afar [m]."""

SUN, SUN_INTENSITY = 0xFFF6E8, 0.62
FILL, FILL_INTENSITY = 0xDCE8FF, 0.3
SKY, GROUND, SKY_INTENSITY = 0xFFFFFF, 0xB9C0C8, 0.3
"""Light from the left and from the right, as on that page."""

ROOM = (
    (0x5C6066, (12, 12, 8), (0, 0, 2)),
    (0xFFFFFF, (5, 2.4, 0.1), (1, -1, 5.4)),
    (0xE8F0FF, (0.1, 6, 3), (-5.5, 0, 2.5)),
    (0xFFF4E4, (6, 0.1, 2.4), (0, -5.6, 3)),
)
"""Colours, sizes and centres [m] of the boxes whose light is reflected: walls, then panels."""

SHADOW_REACH = 1.75
"""Half the extent of the shadow map, about the origin [m]."""

DIRECTIONS = 4096
"""From which light of the room is summed up."""

IRRADIANCE_NODES, REFLECTION_NODES = 17, 33
"""Nodes along each side of the octahedral maps."""


def lit(finishes: Sequence[Finish], texels: int) -> tuple[Materials, Lights]:
    """Finishes in the replay page's light, with an empty shadow map of some texels a side."""
    places = np.array([SUN_PLACE, FILL_PLACE])
    directions = places / np.linalg.norm(places, axis=1, keepdims=True)
    right = np.cross((0.0, 0.0, 1.0), directions[0])
    right /= np.linalg.norm(right)
    scale = texels / (2 * SHADOW_REACH)
    turn = [scale * right, scale * np.cross(directions[0], right), directions[0]]
    sun = SUN_INTENSITY * channels(SUN)
    fill = FILL_INTENSITY * channels(FILL)
    lights = Lights(
        directions=directions,
        colours=np.array([sun, fill]),
        sky=SKY_INTENSITY * channels(SKY),
        ground=SKY_INTENSITY * channels(GROUND),
        irradiance=irradiance_map(),
        sunward=np.column_stack([turn, (texels / 2, texels / 2, 0.0)]),
        shadow=np.empty((texels, texels), dtype=np.float32),
    )
    materials = Materials(
        colour=to_linear([channels(finish.colour) for finish in finishes]),
        emission=np.zeros((len(finishes), 3)),
        roughness=np.array([finish.roughness for finish in finishes]),
        metalness=np.array([finish.metalness for finish in finishes]),
        reflections=np.array([reflection_map(finish.roughness) for finish in finishes]),
    )
    return materials, lights


@lru_cache(maxsize=1)
def irradiance_map() -> Array:
    """Light of the room on surfaces that face a direction, shape (n, n, 3)."""
    return _blurred(IRRADIANCE_NODES, lambda cosine: np.maximum(cosine, 0.0))


@lru_cache(maxsize=64)
def reflection_map(roughness: float) -> Array:
    """Light of the room as surfaces of a roughness mirror it, shape (n, n, 3)."""
    square = roughness**4

    def lobe(cosine: Array) -> Array:
        half = (1.0 + cosine) / 2  # squared cosine of half the angle
        return np.maximum(cosine, 0) / (half * (square - 1) + 1) ** 2

    return _blurred(REFLECTION_NODES, lobe)


def _blurred(nodes: int, lobe: Callable[[Array], Array]) -> Array:
    """Mean light of the room, weighted by a function of the cosine to each node's direction."""
    directions = _even_directions()
    radiance = _room_radiance(directions)
    weights = lobe(_node_directions(nodes) @ directions.T)
    mean: Array = (weights @ radiance) / weights.sum(axis=1, keepdims=True)
    return mean.reshape(nodes, nodes, 3)


def _even_directions() -> Array:
    """Unit vectors that are spread evenly (Fibonacci's spiral), shape (n, 3)."""
    number = np.arange(DIRECTIONS) + 0.5
    z = 1 - 2 * number / DIRECTIONS
    turn = np.pi * (1 + np.sqrt(5)) * number
    across = np.sqrt(1 - z**2)
    return np.column_stack([across * np.cos(turn), across * np.sin(turn), z])


def _node_directions(nodes: int) -> Array:
    """Unit vectors of the nodes of an octahedral map, row by row, shape (nodes ** 2, 3)."""
    v, u = np.meshgrid(*[np.linspace(-1, 1, nodes)] * 2, indexing="ij")
    z = 1 - np.abs(u) - np.abs(v)
    side_u, side_v = np.copysign(1, u), np.copysign(1, v)
    x = np.where(z < 0, (1 - np.abs(v)) * side_u, u)
    y = np.where(z < 0, (1 - np.abs(u)) * side_v, v)
    directions = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    unit: Array = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return unit


def _room_radiance(directions: Array) -> Array:
    """Colours of the boxes' sides that are seen from the origin, shape (n, 3)."""
    nearest = np.full(len(directions), np.inf)
    colours = np.zeros((len(directions), 3))
    with np.errstate(divide="ignore"):
        inverse = 1 / directions
    for colour, size, centre in ROOM:
        low, high = (np.array(centre) + sign * np.array(size) / 2 for sign in (-1, 1))
        ends = np.stack([low * inverse, high * inverse])
        enter, leave = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
        distance = np.where(enter > 0, enter, leave)
        seen = (leave >= enter) & (leave > 0) & (distance < nearest)
        nearest[seen], colours[seen] = distance[seen], channels(colour)
    return colours
