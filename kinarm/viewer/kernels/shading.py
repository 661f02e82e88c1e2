"""Samples to pixels: which surface is seen, how it is lit, and what lies over it."""

import math

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.compiling import Array, Vector, helper, inlined, kernel
from kinarm.viewer.kernels.lighting import light_up, sunlit, unit
from kinarm.viewer.kernels.rasterising import edge
from kinarm.viewer.kernels.views import Backdrop, Balls, Eye, Lights, Materials, Surfaces, View

FLOOR = 0
"""Material of the floor."""


@inlined
def _encoded(gamma: Array, value: float) -> float:
    """Encode a linear value as sRGB."""
    code: float = gamma[int(min(max(value, 0.0), 1.0) * (gamma.shape[0] - 1) + 0.5)]
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
    """Barycentric coordinates of the place of a triangle that is seen at a place of the picture."""
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
    """Row of a table between three rows."""
    i, j, k = corners
    a, b, c = share
    return (
        a * table[i, 0] + b * table[j, 0] + c * table[k, 0],
        a * table[i, 1] + b * table[j, 1] + c * table[k, 1],
        a * table[i, 2] + b * table[j, 2] + c * table[k, 2],
    )


@inlined
def _line_cover(across: float, radius: float, step: float, slope: float, width: float) -> float:
    """Share of a pixel that the nearest of lines covers; ``slope`` is a pixel's size [m]."""
    line = step * math.floor(across / step + 0.5)
    if abs(line) >= radius:
        return 0.0
    return min(max(0.5 * width + 0.5 - abs(across - line) / max(slope, 1e-9), 0.0), min(width, 1.0))


@inlined
def _grid_cover(eye: Eye, backdrop: Backdrop, x: float, y: float, ahead: float) -> float:
    """Share of a pixel that is covered by lines, where the floor is seen there."""
    rays = eye.rays
    dx, dy, dz = _line_of_sight(eye, x, y)
    px, py = eye.position[0] + ahead * dx, eye.position[1] + ahead * dy
    radius, step, width = backdrop.grid_radius, backdrop.grid_step, backdrop.line_width
    if px * px + py * py > radius * radius:
        return 0.0
    column_x = ahead * (rays[1, 0] - dx * rays[1, 2] / dz)
    column_y = ahead * (rays[1, 1] - dy * rays[1, 2] / dz)
    row_x = ahead * (rays[2, 0] - dx * rays[2, 2] / dz)
    row_y = ahead * (rays[2, 1] - dy * rays[2, 2] / dz)
    slope_x = math.sqrt(column_x * column_x + row_x * row_x)
    slope_y = math.sqrt(column_y * column_y + row_y * row_y)
    return max(
        _line_cover(px, radius, step, slope_x, width), _line_cover(py, radius, step, slope_y, width)
    )


@inlined
def _faded(backdrop: Backdrop, ahead: float) -> float:
    """How much of a surface at a distance is lost in the background."""
    share = (ahead - backdrop.fog[0]) / (backdrop.fog[1] - backdrop.fog[0])
    share = min(max(share, 0.0), 1.0)
    fog: float = share * share * (3.0 - 2.0 * share)
    return fog


@inlined
def _finished(backdrop: Backdrop, light: Vector, lines: float, fog: float) -> Vector:
    """Encode light, with lines over it, in the fog."""
    back, grid, gamma = backdrop.colour, backdrop.grid, backdrop.gamma
    red, green, blue = (
        _encoded(gamma, light[0]),
        _encoded(gamma, light[1]),
        _encoded(gamma, light[2]),
    )
    return (
        (1.0 - fog) * (red + lines * (grid[0] - red)) + fog * back[0],
        (1.0 - fog) * (green + lines * (grid[1] - green)) + fog * back[1],
        (1.0 - fog) * (blue + lines * (grid[2] - blue)) + fog * back[2],
    )


@inlined
def _surface_colour(
    eye: Eye,
    surfaces: Surfaces,
    materials: Materials,
    lights: Lights,
    backdrop: Backdrop,
    face: int,
    x: float,
    y: float,
) -> Vector:
    """Colour of a triangle that is seen at a place of the picture."""
    dx, dy, dz = _line_of_sight(eye, x, y)
    corners = surfaces.faces[face, 0], surfaces.faces[face, 1], surfaces.faces[face, 2]
    share = _shares(surfaces, face, x, y)
    px, py, pz = _mixed(surfaces.places, corners, share)
    nx, ny, nz = _mixed(surfaces.normals, corners, share)
    ahead = (
        share[0] * surfaces.corners[corners[0], 2]
        + share[1] * surfaces.corners[corners[1], 2]
        + share[2] * surfaces.corners[corners[2], 2]
    )
    material = surfaces.materials[corners[0]]
    view, sun = unit((-dx, -dy, -dz)), sunlit(lights, (px, py, pz))
    light = light_up(materials, lights, material, sun, unit((nx, ny, nz)), view)
    return _finished(backdrop, light, 0.0, _faded(backdrop, ahead))


@inlined
def _floor_distance(eye: Eye, backdrop: Backdrop, x: float, y: float) -> float:
    """Distance ahead of the floor that is seen at a place of the picture; 0 if none is."""
    dx, dy, dz = _line_of_sight(eye, x, y)
    if dz >= 0.0 or eye.position[2] <= 0.0:
        return 0.0
    ahead = -eye.position[2] / dz
    px, py = eye.position[0] + ahead * dx, eye.position[1] + ahead * dy
    radius: float = backdrop.floor_radius
    return ahead if px * px + py * py < radius * radius else 0.0


@kernel
def paint_floor(
    eye: Eye,
    materials: Materials,
    lights: Lights,
    backdrop: Backdrop,
    floor: NDArray[np.float32],
) -> None:
    """Colour floor and background, in shadow and in the sun.

    Parameters
    ----------
    eye, materials, lights, backdrop
        Parts of a `View`.
    floor : ndarray of float32, shape (height, width, 2, 3)
        Filled in.
    """
    back = backdrop.colour
    for row in range(floor.shape[0]):
        for column in range(floor.shape[1]):
            x, y = column + 0.5, row + 0.5
            ahead = _floor_distance(eye, backdrop, x, y)
            for sun in range(2):
                colour = back[0], back[1], back[2]
                if ahead > 0.0:
                    dx, dy, dz = _line_of_sight(eye, x, y)
                    up, view = (0.0, 0.0, 1.0), unit((-dx, -dy, -dz))
                    light = light_up(materials, lights, FLOOR, float(sun), up, view)
                    lines = _grid_cover(eye, backdrop, x, y, ahead)
                    colour = _finished(backdrop, light, lines, _faded(backdrop, ahead))
                for channel in range(3):
                    floor[row, column, sun, channel] = colour[channel]


@inlined
def _floor_colour(
    eye: Eye,
    lights: Lights,
    backdrop: Backdrop,
    floor: NDArray[np.float32],
    row: int,
    column: int,
) -> Vector:
    """Colour of the floor at a pixel."""
    ahead = _floor_distance(eye, backdrop, column + 0.5, row + 0.5)
    sun = 1.0
    if ahead > 0.0:
        dx, dy, _ = _line_of_sight(eye, column + 0.5, row + 0.5)
        sun = sunlit(lights, (eye.position[0] + ahead * dx, eye.position[1] + ahead * dy, 0.0))
    return (
        floor[row, column, 0, 0] + sun * (floor[row, column, 1, 0] - floor[row, column, 0, 0]),
        floor[row, column, 0, 1] + sun * (floor[row, column, 1, 1] - floor[row, column, 0, 1]),
        floor[row, column, 0, 2] + sun * (floor[row, column, 1, 2] - floor[row, column, 0, 2]),
    )


@inlined
def _ball_cover(
    eye: Eye,
    balls: Balls,
    ball: int,
    nearness: NDArray[np.float32],
    row: int,
    column: int,
) -> float:
    """Share of a pixel's samples at which a ball is seen."""
    cx = balls.centres[ball, 0] - eye.position[0]
    cy = balls.centres[ball, 1] - eye.position[1]
    cz = balls.centres[ball, 2] - eye.position[2]
    beyond = cx * cx + cy * cy + cz * cz - balls.radii[ball] * balls.radii[ball]
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
        if balls.on_top[ball] or nearness[row, column, sample] * ahead < 1.0:
            covered += 1
    cover: float = covered / n_samples
    return cover


@helper
def _shade_row(row: int, view: View, picture: NDArray[np.uint8]) -> None:
    """Colour a row of pixels."""
    eye, surfaces, materials, lights, backdrop, balls, floor, nearness, index = view
    offsets = eye.offsets
    n_samples = offsets.shape[0]
    for column in range(index.shape[1]):
        red, green, blue = 0.0, 0.0, 0.0
        done = 0
        for sample in range(n_samples):
            face = index[row, column, sample]
            if done == n_samples:
                break
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
            x, y = column + x / count, row + y / count
            if face < 0:
                r, g, b = _floor_colour(eye, lights, backdrop, floor, row, column)
            else:
                r, g, b = _surface_colour(eye, surfaces, materials, lights, backdrop, face, x, y)
            red += count * r
            green += count * g
            blue += count * b
        red, green, blue = red / n_samples, green / n_samples, blue / n_samples
        for ball in range(balls.radii.shape[0]):
            veil = balls.opacities[ball] * _ball_cover(eye, balls, ball, nearness, row, column)
            red += veil * (balls.colours[ball, 0] - red)
            green += veil * (balls.colours[ball, 1] - green)
            blue += veil * (balls.colours[ball, 2] - blue)
        picture[row, column, 0] = int(255.0 * red + 0.5)
        picture[row, column, 1] = int(255.0 * green + 0.5)
        picture[row, column, 2] = int(255.0 * blue + 0.5)


@kernel
def shade(view: View, picture: NDArray[np.uint8]) -> None:
    """Colour all pixels.

    What is seen at several samples of a pixel is lit once, in their middle.
    """
    for row in range(picture.shape[0]):
        _shade_row(row, view, picture)
