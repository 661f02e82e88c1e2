"""Samples to pixels: seen surfaces, their light, and what covers them."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.compiling import Array, Vector, inlined, kernel
from kinarm.viewer.kernels.rasterising import Eye, Surfaces, edge
from kinarm.viewer.lighting import Lights, Materials, light_up, sunlit, unit
from kinarm.viewer.parts import FLOOR_RADIUS, GRID_RADIUS, GRID_STEP, channels, to_srgb

FLOOR = 0
"""Material of the floor."""

BACKGROUND, GRID = (tuple(channels(colour).tolist()) for colour in (0xEEF1F4, 0xB4BDC7))
"""Colours, in sRGB, of the background and of the floor's lines."""

GAMMA = to_srgb(np.linspace(0, 1, 4096))
"""Encoded linear values from 0 to 1."""


class View(NamedTuple):
    """All that a picture shows.

    balls (n, 9): glowing balls: centre, radius, colour in sRGB, opacity, and whether everything
    lets it through (1).
    floor (height, width, 2, 3): colours of floor and background, in shadow and in the sun.
    nearness (height, width, n_samples): one over the distance ahead of what is seen [1/m].
    seen (height, width, n_samples): triangle that is seen; negative for the floor.
    """

    eye: Eye
    surfaces: Surfaces
    materials: Materials
    lights: Lights
    balls: Array
    floor: NDArray[np.float32]
    nearness: NDArray[np.float32]
    seen: NDArray[np.int32]


@inlined
def _encoded(value: float) -> float:
    """Encode a linear value as sRGB."""
    code: float = GAMMA[int(min(max(value, 0.0), 1.0) * (GAMMA.shape[0] - 1) + 0.5)]
    return code


@inlined
def _line_of_sight(eye: Eye, x: float, y: float) -> Vector:
    """Direction of a place in the picture."""
    rays = eye.rays
    return (
        rays[0, 0] + x * rays[1, 0] + y * rays[2, 0],
        rays[0, 1] + x * rays[1, 1] + y * rays[2, 1],
        rays[0, 2] + x * rays[1, 2] + y * rays[2, 2],
    )


@inlined
def _shares(surfaces: Surfaces, face: int, x: float, y: float) -> Vector:
    """Barycentric coordinates, in a triangle, of a place of the picture."""
    corners, faces = surfaces.corners, surfaces.faces
    i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
    at_i = corners[i, 0], corners[i, 1], corners[i, 2]
    at_j = corners[j, 0], corners[j, 1], corners[j, 2]
    at_k = corners[k, 0], corners[k, 1], corners[k, 2]
    a, b, c = edge(at_j, at_k)
    share_i = a * x + b * y + c
    a, b, c = edge(at_k, at_i)
    share_j = a * x + b * y + c
    a, b, c = edge(at_i, at_j)
    share_k = a * x + b * y + c
    scale = 1.0 / (share_i + share_j + share_k)
    return share_i * scale, share_j * scale, share_k * scale


@inlined
def _mixed(table: Array, corners: tuple[int, int, int], share: Vector) -> Vector:
    """Mixture of three rows of a table."""
    i, j, k = corners
    a, b, c = share
    return (
        a * table[i, 0] + b * table[j, 0] + c * table[k, 0],
        a * table[i, 1] + b * table[j, 1] + c * table[k, 1],
        a * table[i, 2] + b * table[j, 2] + c * table[k, 2],
    )


@inlined
def _line_cover(across: float, slope: float, width: float) -> float:
    """Share of a pixel, of a size ``slope`` [m], that the nearest line covers."""
    line = GRID_STEP * math.floor(across / GRID_STEP + 0.5)
    if abs(line) >= GRID_RADIUS:
        return 0.0
    return min(max(0.5 * width + 0.5 - abs(across - line) / max(slope, 1e-9), 0.0), min(width, 1.0))


@inlined
def _grid_cover(eye: Eye, line_width: float, x: float, y: float, ahead: float) -> float:
    """Share of a pixel on the floor that lines cover."""
    rays = eye.rays
    dx, dy, dz = _line_of_sight(eye, x, y)
    px, py = eye.position[0] + ahead * dx, eye.position[1] + ahead * dy
    if px * px + py * py > GRID_RADIUS * GRID_RADIUS:
        return 0.0
    column_x = ahead * (rays[1, 0] - dx * rays[1, 2] / dz)
    column_y = ahead * (rays[1, 1] - dy * rays[1, 2] / dz)
    row_x = ahead * (rays[2, 0] - dx * rays[2, 2] / dz)
    row_y = ahead * (rays[2, 1] - dy * rays[2, 2] / dz)
    slope_x = math.sqrt(column_x * column_x + row_x * row_x)
    slope_y = math.sqrt(column_y * column_y + row_y * row_y)
    return max(_line_cover(px, slope_x, line_width), _line_cover(py, slope_y, line_width))


@inlined
def _faded(eye: Eye, ahead: float) -> float:
    """How far a surface at a distance has faded into the background."""
    share = (ahead - eye.fog[0]) / (eye.fog[1] - eye.fog[0])
    share = min(max(share, 0.0), 1.0)
    fog: float = share * share * (3.0 - 2.0 * share)
    return fog


@inlined
def _towards(colour: Vector, other: Vector, share: float) -> Vector:
    """A colour between two."""
    return (
        colour[0] + share * (other[0] - colour[0]),
        colour[1] + share * (other[1] - colour[1]),
        colour[2] + share * (other[2] - colour[2]),
    )


@inlined
def _finished(light: Vector, lines: float, fog: float) -> Vector:
    """Encode light, add lines, and fade it."""
    encoded = _encoded(light[0]), _encoded(light[1]), _encoded(light[2])
    red, green, blue = _towards(encoded, GRID, lines)
    return (
        (1.0 - fog) * red + fog * BACKGROUND[0],
        (1.0 - fog) * green + fog * BACKGROUND[1],
        (1.0 - fog) * blue + fog * BACKGROUND[2],
    )


@inlined
def _surface_colour(view: View, face: int, x: float, y: float) -> Vector:
    """Colour of a triangle at a place of the picture."""
    surfaces = view.surfaces
    dx, dy, dz = _line_of_sight(view.eye, x, y)
    corners = surfaces.faces[face, 0], surfaces.faces[face, 1], surfaces.faces[face, 2]
    share = _shares(surfaces, face, x, y)
    place = _mixed(surfaces.places, corners, share)
    normal = unit(_mixed(surfaces.normals, corners, share))
    _, _, ahead = _mixed(surfaces.corners, corners, share)
    material, sun = surfaces.materials[corners[0]], sunlit(view.lights, place)
    back = unit((-dx, -dy, -dz))
    light = light_up(view.materials, view.lights, material, sun, normal, back)
    return _finished(light, 0.0, _faded(view.eye, ahead))


@inlined
def _floor_distance(eye: Eye, x: float, y: float) -> float:
    """Distance ahead of the floor at a place of the picture; 0 if unseen."""
    dx, dy, dz = _line_of_sight(eye, x, y)
    if dz >= 0.0 or eye.position[2] <= 0.0:
        return 0.0
    ahead = -eye.position[2] / dz
    px, py = eye.position[0] + ahead * dx, eye.position[1] + ahead * dy
    within: bool = px * px + py * py < FLOOR_RADIUS * FLOOR_RADIUS
    return ahead if within else 0.0


@kernel
def paint_floor(
    eye: Eye,
    materials: Materials,
    lights: Lights,
    line_width: float,
    floor: NDArray[np.float32],
    nearness: NDArray[np.float32],
) -> None:
    """Colour the floor, in shadow and in the sun, and find its nearness.

    Parameters
    ----------
    eye, materials, lights
        Parts of a `View`.
    line_width : float
        Width of a line on the floor [pixels].
    floor, nearness
        Parts of a `View`, filled in where the floor is seen.
    """
    for row in range(floor.shape[0]):
        for column in range(floor.shape[1]):
            for sample in range(nearness.shape[2]):
                x, y = column + eye.offsets[sample, 0], row + eye.offsets[sample, 1]
                _, _, dz = _line_of_sight(eye, x, y)
                if dz < 0.0 and eye.position[2] > 0.0:
                    nearness[row, column, sample] = -dz / max(eye.position[2], 1e-6)
            x, y = column + 0.5, row + 0.5
            ahead = _floor_distance(eye, x, y)
            if ahead > 0.0:
                dx, dy, dz = _line_of_sight(eye, x, y)
                up, view = (0.0, 0.0, 1.0), unit((-dx, -dy, -dz))
                lines, fog = _grid_cover(eye, line_width, x, y, ahead), _faded(eye, ahead)
                for sun in range(2):
                    light = light_up(materials, lights, FLOOR, float(sun), up, view)
                    colour = _finished(light, lines, fog)
                    for channel in range(3):
                        floor[row, column, sun, channel] = colour[channel]


@inlined
def _floor_colour(view: View, row: int, column: int) -> Vector:
    """Colour of the floor at a pixel."""
    eye, floor = view.eye, view.floor
    ahead = _floor_distance(eye, column + 0.5, row + 0.5)
    sun = 1.0
    if ahead > 0.0:
        dx, dy, _ = _line_of_sight(eye, column + 0.5, row + 0.5)
        place = eye.position[0] + ahead * dx, eye.position[1] + ahead * dy, 0.0
        sun = sunlit(view.lights, place)
    dark, lit = floor[row, column, 0], floor[row, column, 1]
    return _towards((dark[0], dark[1], dark[2]), (lit[0], lit[1], lit[2]), sun)


@inlined
def _ball_cover(view: View, ball: int, row: int, column: int) -> float:
    """Share of a pixel's samples at which a ball is seen."""
    eye, balls = view.eye, view.balls
    cx = balls[ball, 0] - eye.position[0]
    cy = balls[ball, 1] - eye.position[1]
    cz = balls[ball, 2] - eye.position[2]
    beyond = cx * cx + cy * cy + cz * cz - balls[ball, 3] * balls[ball, 3]
    covered, n_samples = 0, eye.offsets.shape[0]
    for sample in range(n_samples):
        x, y = column + eye.offsets[sample, 0], row + eye.offsets[sample, 1]
        dx, dy, dz = _line_of_sight(eye, x, y)
        square = dx * dx + dy * dy + dz * dz
        along = dx * cx + dy * cy + dz * cz
        bend = along * along - square * beyond
        if bend <= 0.0 or along <= 0.0 or beyond <= 0.0:
            if sample == 0 and bend < -0.01 * along * along:
                return 0.0
            continue
        ahead = (along - math.sqrt(bend)) / square
        if balls[ball, 8] > 0.0 or view.nearness[row, column, sample] * ahead < 1.0:
            covered += 1
    cover: float = covered / n_samples
    return cover


@kernel
def shade(view: View, picture: NDArray[np.uint8]) -> None:
    """Colour all pixels.

    What several samples of a pixel see is lit once, in their middle.
    """
    index, balls, offsets = view.seen, view.balls, view.eye.offsets
    height, width, n_samples = index.shape
    for row in range(height):
        for column in range(width):
            red, green, blue, done = 0.0, 0.0, 0.0, 0
            for sample in range(n_samples):
                if done == n_samples:
                    break
                face = index[row, column, sample]
                first, count, x, y = True, 0, 0.0, 0.0
                for other in range(n_samples):
                    if index[row, column, other] == face:
                        first = first and other >= sample
                        count += 1
                        x += offsets[other, 0]
                        y += offsets[other, 1]
                if not first:
                    continue
                done += count
                if face < 0:
                    r, g, b = _floor_colour(view, row, column)
                else:
                    r, g, b = _surface_colour(view, face, column + x / count, row + y / count)
                red += count * r
                green += count * g
                blue += count * b
            red, green, blue = red / n_samples, green / n_samples, blue / n_samples
            for ball in range(balls.shape[0]):
                veil = balls[ball, 7] * _ball_cover(view, ball, row, column)
                glow = balls[ball, 4], balls[ball, 5], balls[ball, 6]
                red, green, blue = _towards((red, green, blue), glow, veil)
            picture[row, column, 0] = int(255.0 * red + 0.5)
            picture[row, column, 1] = int(255.0 * green + 0.5)
            picture[row, column, 2] = int(255.0 * blue + 0.5)
