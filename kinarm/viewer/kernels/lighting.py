"""What light does at a place of a surface, by the formulas of three.js' standard material."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.compiling import Array, Vector, helper, inlined


class Materials(NamedTuple):
    """Surfaces, one a row.

    Attributes
    ----------
    colour, emission : ndarray, shape (n, 3)
        Reflected and emitted light, red, green and blue, linear.
    roughness, metalness : ndarray, shape (n,)
        Of three.js' standard material.
    room : ndarray of int, shape (n,)
        Which of the reflections of `Lights` has this roughness.
    """

    colour: Array
    emission: Array
    roughness: Array
    metalness: Array
    room: NDArray[np.int64]


class Lights(NamedTuple):
    """Where light comes from; colours are linear.

    Attributes
    ----------
    directions, colours : ndarray, shape (n, 3)
        Towards lights from afar, and how bright they are. The first is the sun, which casts shadows.
    sky, ground : ndarray, shape (3,)
        Light from above and from below, which fade into each other.
    irradiance : ndarray, shape (n, n, 3)
        Light of the room on surfaces that face a direction, as an octahedral map.
    reflections : ndarray, shape (n_rooms, n, n, 3)
        Light of the room, blurred as it is seen in a rough surface.
    sunward : ndarray, shape (3, 4)
        World to shadow map.
    shadow : ndarray, shape (n, n)
        How near the sun the last surface is that keeps it off [m].
    """

    directions: Array
    colours: Array
    sky: Array
    ground: Array
    irradiance: Array
    reflections: Array
    sunward: Array
    shadow: NDArray[np.float32]


SHADOW_BIAS = 0.002
"""How much nearer the sun a shadow's cause must be [m]."""


@inlined
def octahedral(x: float, y: float, z: float, size: int) -> tuple[int, int, float, float]:
    """Cell of an octahedral map that a direction falls into, and where in the cell."""
    span = 1.0 / (abs(x) + abs(y) + abs(z))
    u, v = x * span, y * span
    if z < 0.0:
        u, v = (1.0 - abs(v)) * math.copysign(1.0, u), (1.0 - abs(u)) * math.copysign(1.0, v)
    u, v = 0.5 * (u + 1.0) * (size - 1), 0.5 * (v + 1.0) * (size - 1)
    column, row = min(int(u), size - 2), min(int(v), size - 2)
    return row, column, v - row, u - column


@inlined
def look_up(table: Array, row: int, column: int, v: float, u: float, channel: int) -> float:
    """Value of a map between its nodes."""
    upper = (1.0 - u) * table[row, column, channel] + u * table[row, column + 1, channel]
    lower = (1.0 - u) * table[row + 1, column, channel] + u * table[row + 1, column + 1, channel]
    return (1.0 - v) * upper + v * lower


@inlined
def sunlit(lights: Lights, x: float, y: float, z: float) -> float:
    """Share of the sun that reaches a place, averaged over three by three texels."""
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


@helper
def light_up(
    materials: Materials,
    lights: Lights,
    material: int,
    place: Vector,
    normal: Vector,
    view: Vector,
) -> Vector:
    """Light that a surface sends to the eye; ``normal`` and ``view`` are unit vectors.

    Direct light: GGX with Smith's visibility and Schlick's Fresnel term. The room's: Karis' fit
    of what a rough surface reflects, and Fdez-Aguera's of what it reflects more than once.
    """
    x, y, z = normal
    facing = max(x * view[0] + y * view[1] + z * view[2], 0.0)
    roughness, metalness = materials.roughness[material], materials.metalness[material]
    alpha = roughness * roughness
    square = alpha * alpha
    mirrored = 2.0 * (x * view[0] + y * view[1] + z * view[2])
    rx = (mirrored * x - view[0]) * (1.0 - alpha) + x * alpha
    ry = (mirrored * y - view[1]) * (1.0 - alpha) + y * alpha
    rz = (mirrored * z - view[2]) * (1.0 - alpha) + z * alpha

    # The room: shares that a mirror of colour 1 returns at once, and what any surface adds.
    r0, r1 = 1.0 - roughness, 0.0425 - 0.0275 * roughness
    r2, r3 = 1.04 - 0.572 * roughness, 0.022 * roughness - 0.04
    bend = min(r0 * r0, 2.0 ** (-9.28 * facing)) * r0 + r1
    slope, base = r2 - 1.04 * bend, r3 + 1.04 * bend
    lost = 1.0 - slope - base

    wide = lights.irradiance.shape[0]
    row, column, v, u = octahedral(x, y, z, wide)
    rooms = lights.reflections[materials.room[material]]
    fine = rooms.shape[0]
    row_r, column_r, v_r, u_r = octahedral(rx, ry, rz, fine)

    # Lights from afar: cosine, and specular factor without the Fresnel term.
    n_lights = lights.directions.shape[0]
    up = 0.5 + 0.5 * z
    sun = sunlit(lights, place[0], place[1], place[2])
    red, green, blue = 0.0, 0.0, 0.0
    for channel in range(3):
        colour = materials.colour[material, channel]
        body = colour * (1.0 - metalness)
        mirror = 0.04 + (colour - 0.04) * metalness
        around = look_up(lights.irradiance, row, column, v, u, channel)
        single = mirror * slope + base
        average = mirror + (1.0 - mirror) * 0.047619
        multiple = single * average / (1.0 - lost * average) * lost
        room = look_up(rooms, row_r, column_r, v_r, u_r, channel)
        sky = lights.ground[channel] + up * (lights.sky[channel] - lights.ground[channel])
        total = materials.emission[material, channel] + body * sky
        total += room * single + around * (multiple + body * (1.0 - single - multiple))
        for k in range(n_lights):
            lx, ly, lz = lights.directions[k, 0], lights.directions[k, 1], lights.directions[k, 2]
            cosine = x * lx + y * ly + z * lz
            if cosine <= 0.0:
                continue
            hx, hy, hz = lx + view[0], ly + view[1], lz + view[2]
            length = math.sqrt(hx * hx + hy * hy + hz * hz)
            half = max(x * hx + y * hy + z * hz, 0.0) / length
            towards = (view[0] * hx + view[1] * hy + view[2] * hz) / length
            spread = half * half * (square - 1.0) + 1.0
            shine = cosine * math.sqrt(square + (1.0 - square) * facing * facing)
            shine += facing * math.sqrt(square + (1.0 - square) * cosine * cosine)
            gloss = 0.5 * square / (spread * spread * max(shine, 1e-6))
            fresnel = mirror + (1.0 - mirror) * 2.0 ** ((-5.55473 * towards - 6.98316) * towards)
            share = cosine * (sun if k == 0 else 1.0)
            total += share * lights.colours[k, channel] * (body + gloss * fresnel)
        if channel == 0:
            red = total
        elif channel == 1:
            green = total
        else:
            blue = total
    return red, green, blue
