"""Light on a stage, as on the replay page: sun, fill, sky, and a bright room that is reflected.

Kernels light surfaces by three.js' standard material. Lengths are in metres, shapes of arrays in
brackets, and colours linear red, green and blue.
"""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.compiling import Array, Vector, inlined
from kinarm.viewer.parts import Finish, channels, to_linear

SUN_PLACE = (-2.0, -1.0, 3.4)
FILL_PLACE = (-2.5, 1.8, -2.2)
"""Places of the lights, which shine on the origin [m]."""

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
"""Colours, sizes and centres [m] of reflected boxes: walls, then panels."""

SHADOW_REACH = 1.75
"""Half the extent of the shadow map, about the origin [m]."""

DIRECTIONS = 4096
"""Directions from which the room's light is summed up."""

IRRADIANCE_NODES, REFLECTION_NODES = 17, 33
"""Nodes along each side of the octahedral maps."""

SHADOW_BIAS = 0.002
"""How much nearer the sun a shadow's cause must be [m]."""

LOG_2 = math.log(2.0)

Cell = tuple[int, int, float, float]
"""Row and column in a map, and the shares of the next row and column."""


class Materials(NamedTuple):
    """Finishes of three.js' standard material, one a row; the first is the floor's.

    colour, emission (n, 3): reflected and emitted light.
    roughness, metalness (n,): in 0..1.
    reflections (n, k, k, 3): octahedral maps of the room's light, blurred by such a mirror.
    """

    colour: Array
    emission: Array
    roughness: Array
    metalness: Array
    reflections: Array


class Lights(NamedTuple):
    """Where light comes from.

    directions, colours (2, 3): towards the sun, which casts shadows, and a second light from afar.
    sky, ground (3,): light from the left (y) and from the right, which fade into each other.
    irradiance (n, n, 3): octahedral map of the room's light on surfaces that face a direction.
    sunward (3, 4): world to shadow map.
    shadow (n, n): how near the sun the last surface is that keeps it off.
    """

    directions: Array
    colours: Array
    sky: Array
    ground: Array
    irradiance: Array
    sunward: Array
    shadow: NDArray[np.float32]


@inlined
def unit(vector: Vector) -> Vector:
    """Scale a vector to length 1."""
    x, y, z = vector
    scale = 1.0 / max(math.sqrt(x * x + y * y + z * z), 1e-12)
    return x * scale, y * scale, z * scale


@inlined
def _octahedral(x: float, y: float, z: float, size: int) -> Cell:
    """Cell of an octahedral map that a direction falls into."""
    span = 1.0 / max(abs(x) + abs(y) + abs(z), 1e-12)
    u, v = x * span, y * span
    if z < 0.0:
        u, v = (1.0 - abs(v)) * math.copysign(1.0, u), (1.0 - abs(u)) * math.copysign(1.0, v)
    u, v = 0.5 * (u + 1.0) * (size - 1), 0.5 * (v + 1.0) * (size - 1)
    column, row = min(int(u), size - 2), min(int(v), size - 2)
    return row, column, v - row, u - column


@inlined
def _look_up(table: Array, cell: Cell, channel: int) -> float:
    """Value of a map between its nodes."""
    row, column, v, u = cell
    upper = (1.0 - u) * table[row, column, channel] + u * table[row, column + 1, channel]
    lower = (1.0 - u) * table[row + 1, column, channel] + u * table[row + 1, column + 1, channel]
    value: float = (1.0 - v) * upper + v * lower
    return value


@inlined
def sunlit(lights: Lights, place: Vector) -> float:
    """Share of the sun that reaches a place, averaged over 3 x 3 texels."""
    x, y, z = place
    m, shadow = lights.sunward, lights.shadow
    u = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3] - 1.5
    v = m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3] - 1.5
    near = m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + m[2, 3] + SHADOW_BIAS
    size = shadow.shape[0]
    if not (0.0 <= u < size - 4 and 0.0 <= v < size - 4):
        return 1.0
    left, top = int(u), int(v)
    right_share, bottom_share = u - left, v - top
    light = 0.0
    for row in range(4):
        high = 1.0 - bottom_share if row == 0 else bottom_share if row == 3 else 1.0
        for column in range(4):
            if shadow[top + row, left + column] <= near:
                wide = 1.0 - right_share if column == 0 else right_share if column == 3 else 1.0
                light += high * wide
    return light / 9.0


@inlined
def _shine(
    lights: Lights, light: int, normal: Vector, view: Vector, square: float, facing: float
) -> Vector:
    """Light from afar on a surface.

    Returns the cosine of the light's angle, and it times GGX with Smith's visibility, in two parts
    by Schlick's Fresnel term: for a mirror of colour 1, and for any surface.
    """
    x, y, z = normal
    towards = lights.directions
    lx, ly, lz = towards[light, 0], towards[light, 1], towards[light, 2]
    cosine = x * lx + y * ly + z * lz
    if cosine <= 0.0:
        return 0.0, 0.0, 0.0
    hx, hy, hz = unit((lx + view[0], ly + view[1], lz + view[2]))
    half = max(x * hx + y * hy + z * hz, 0.0)
    tilt = view[0] * hx + view[1] * hy + view[2] * hz
    fresnel = math.exp(LOG_2 * (-5.55473 * tilt - 6.98316) * tilt)
    spread = half * half * (square - 1.0) + 1.0
    hidden = cosine * math.sqrt(square + (1.0 - square) * facing * facing)
    hidden += facing * math.sqrt(square + (1.0 - square) * cosine * cosine)
    gloss = 0.5 * cosine * square / (spread * spread * max(hidden, 1e-6))
    return cosine, gloss * (1.0 - fresnel), gloss * fresnel


@inlined
def light_up(
    materials: Materials,
    lights: Lights,
    material: int,
    share: float,
    normal: Vector,
    view: Vector,
) -> Vector:
    """Light that a surface sends to the eye: red, green and blue, linear.

    The room's light follows Karis' fit of what a rough surface mirrors, and
    Fdez-Aguera's of what it mirrors repeatedly.

    Parameters
    ----------
    materials, lights, material
        As in a `View`, and the row of the surface's material.
    share : float
        Share of the sun that reaches it.
    normal, view : tuple of float
        Unit vectors: away from the surface, and towards the eye.
    """
    x, y, z = normal
    roughness, metalness = materials.roughness[material], materials.metalness[material]
    alpha = roughness * roughness
    along = x * view[0] + y * view[1] + z * view[2]
    facing = max(along, 0.0)

    # How a rough surface mirrors the room once, in parts by its colour, and what is lost.
    bend = math.exp(-9.28 * LOG_2 * facing)
    bend = min((1.0 - roughness) ** 2, bend) * (1.0 - roughness) + 0.0425 - 0.0275 * roughness
    slope = 1.04 - 0.572 * roughness - 1.04 * bend  # per mirrored light of a colour
    base = 0.022 * roughness - 0.04 + 1.04 * bend  # and of any
    lost = 1.0 - slope - base
    # Where the maps of the room are looked up, and the two lights from afar.
    around = _octahedral(x, y, z, lights.irradiance.shape[0])
    table = materials.reflections[material]
    mirrored = _octahedral(
        (2.0 * along * x - view[0]) * (1.0 - alpha) + x * alpha,
        (2.0 * along * y - view[1]) * (1.0 - alpha) + y * alpha,
        (2.0 * along * z - view[2]) * (1.0 - alpha) + z * alpha,
        table.shape[0],
    )
    sun = _shine(lights, 0, normal, view, alpha * alpha, facing)
    fill = _shine(lights, 1, normal, view, alpha * alpha, facing)

    # Sums of all light, by channel.
    light = (0.0, 0.0, 0.0)
    for channel in range(3):
        colour = materials.colour[material, channel]
        body = colour * (1.0 - metalness)
        mirror = 0.04 + (colour - 0.04) * metalness
        room = _look_up(lights.irradiance, around, channel)
        once = mirror * slope + base
        mean = mirror + (1.0 - mirror) * 0.047619
        again = once * mean / (1.0 - lost * mean) * lost
        total = materials.emission[material, channel]
        total += once * _look_up(table, mirrored, channel)
        total += room * (again + body * (1.0 - once - again))
        ground, sky = lights.ground[channel], lights.sky[channel]
        total += body * (ground + (0.5 + 0.5 * y) * (sky - ground))
        direct = body * sun[0] + mirror * sun[1] + sun[2]
        total += share * lights.colours[0, channel] * direct
        total += lights.colours[1, channel] * (body * fill[0] + mirror * fill[1] + fill[2])
        light = light[1], light[2], total
    return light


def lit(finishes: Sequence[Finish], texels: int) -> tuple[Materials, Lights]:
    """Finishes in the replay page's light, with an empty shadow map."""
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
    """Mean light of the room, weighted by a function of the cosine."""
    directions = _even_directions()
    radiance = _room_radiance(directions)
    weights = lobe(_node_directions(nodes) @ directions.T)
    mean: Array = (weights @ radiance) / weights.sum(axis=1, keepdims=True)
    return mean.reshape(nodes, nodes, 3)


def _even_directions() -> Array:
    """Evenly spread unit vectors (Fibonacci's spiral), shape (n, 3)."""
    number = np.arange(DIRECTIONS) + 0.5
    z = 1 - 2 * number / DIRECTIONS
    turn = np.pi * (1 + np.sqrt(5)) * number
    across = np.sqrt(1 - z**2)
    return np.column_stack([across * np.cos(turn), across * np.sin(turn), z])


def _node_directions(nodes: int) -> Array:
    """Unit vectors of an octahedral map's nodes by rows, shape (nodes ** 2, 3)."""
    v, u = np.meshgrid(*[np.linspace(-1, 1, nodes)] * 2, indexing="ij")
    z = 1 - np.abs(u) - np.abs(v)
    side_u, side_v = np.copysign(1, u), np.copysign(1, v)
    x = np.where(z < 0, (1 - np.abs(v)) * side_u, u)
    y = np.where(z < 0, (1 - np.abs(u)) * side_v, v)
    directions = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    unit: Array = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return unit


def _room_radiance(directions: Array) -> Array:
    """Colours of the boxes seen from the origin, shape (n, 3)."""
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
