"""Light on a stage, as on the replay page: sun, fill, sky, and a bright room that is reflected.

Kernels light surfaces by three.js' standard material. Lengths are in metres, shapes of arrays in
brackets, and colours linear red, green and blue.
"""

import math
from collections.abc import Sequence
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

ROOM = np.array(
    [
        (0.4112, 0.4256, 0.4476),
        *((-0.0396, -0.0411, -0.0444), (-0.0473, -0.0435, -0.0381), (0.09, 0.0875, 0.0843)),
        *((-0.0061, -0.0058, -0.0054), (-0.1253, -0.1166, -0.1038), (-0.0551, -0.0583, -0.065)),
        *((0.0119, 0.0166, 0.0247), (0.0179, 0.0173, 0.0162)),
    ]
)
"""Light of that page's room from a direction: shares of 1; x, y, z; and xy, yz, zx, xx - yy,
3 zz - 1, which fit its walls and bright panels best."""

DULL = (2 / 3, 1 / 4)
"""How far surfaces blur the second and third line of that where they scatter all light
(Ramamoorthi and Hanrahan, 2001)."""

SHADOW_REACH = 1.75
"""Half the extent of the shadow map, about the origin [m]."""

SHADOW_BIAS = 0.002
"""How much nearer the sun a shadow's cause must be [m]."""

SUN_DEPTH = 25.0
"""How far from the origin, towards the sun and away, shadows are cast [m]."""

LOG_2 = math.log(2.0)


class Materials(NamedTuple):
    """Finishes of three.js' standard material, one a row; the first is the floor's.

    colour, emission (n, 3): reflected and emitted light.
    roughness, metalness (n,): in 0..1.
    reflections (n, 9, 3): the room's light as `ROOM`, blurred by such a mirror.
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
    irradiance (9, 3): the same on surfaces that face a direction.
    sunward (3, 4): world to shadow map.
    shadow (n, n, 1): how near the sun the last surface is that keeps it off, plus `SUN_DEPTH`; the
    backs of surfaces, since fronts would shadow themselves.
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
def _of_room(light: Array, direction: Vector, channel: int) -> float:
    """Light of the room, as `ROOM`, that belongs to a direction."""
    x, y, z = direction
    value: float = light[0, channel]
    value += x * light[1, channel] + y * light[2, channel] + z * light[3, channel]
    value += x * y * light[4, channel] + y * z * light[5, channel] + z * x * light[6, channel]
    value += (x * x - y * y) * light[7, channel] + (3.0 * z * z - 1.0) * light[8, channel]
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
            if shadow[top + row, left + column, 0] <= near:
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
    # From where light is mirrored, and the two lights from afar.
    reflections = materials.reflections[material]
    mirrored = unit(
        (
            (2.0 * along * x - view[0]) * (1.0 - alpha) + x * alpha,
            (2.0 * along * y - view[1]) * (1.0 - alpha) + y * alpha,
            (2.0 * along * z - view[2]) * (1.0 - alpha) + z * alpha,
        )
    )
    sun = _shine(lights, 0, normal, view, alpha * alpha, facing)
    fill = _shine(lights, 1, normal, view, alpha * alpha, facing)

    # Sums of all light, by channel.
    light = (0.0, 0.0, 0.0)
    for channel in range(3):
        colour = materials.colour[material, channel]
        body = colour * (1.0 - metalness)
        mirror = 0.04 + (colour - 0.04) * metalness
        room = _of_room(lights.irradiance, normal, channel)
        once = mirror * slope + base
        mean = mirror + (1.0 - mirror) * 0.047619
        again = once * mean / (1.0 - lost * mean) * lost
        total = materials.emission[material, channel]
        total += once * _of_room(reflections, mirrored, channel)
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
        irradiance=_blurred(*DULL),
        sunward=np.column_stack([turn, (texels / 2, texels / 2, SUN_DEPTH)]),
        shadow=np.empty((texels, texels, 1), dtype=np.float32),
    )
    materials = Materials(
        colour=to_linear([channels(finish.colour) for finish in finishes]),
        emission=np.zeros((len(finishes), 3)),
        roughness=np.array([finish.roughness for finish in finishes]),
        metalness=np.array([finish.metalness for finish in finishes]),
        reflections=np.array([_mirrored(finish.roughness) for finish in finishes]),
    )
    return materials, lights


def _blurred(second: float, third: float) -> Array:
    """The room's light with two of its lines blurred, shape (9, 3)."""
    blurred: Array = ROOM * np.repeat([1.0, second, third], (1, 3, 5))[:, None]
    return blurred


def _mirrored(roughness: float) -> Array:
    """The room's light as surfaces of a roughness mirror it, shape (9, 3)."""
    sharpness = min(1.27 - 0.66 * roughness, 1.0)  # fitted to GGX
    return _blurred(sharpness, sharpness**3)
