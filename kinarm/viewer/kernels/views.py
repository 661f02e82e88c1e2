"""A picture's contents as the kernels need them: the eye, surfaces, materials, lights."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.compiling import Array


class Eye(NamedTuple):
    """From where a picture is seen.

    Attributes
    ----------
    position : ndarray, shape (3,)
        Place of the camera in the world [m].
    rays : ndarray, shape (3, 3)
        Line of sight of the picture's upper left corner, as long as it gets ahead by 1, and what
        is added to it per column and per row.
    offsets : ndarray, shape (n_samples, 2)
        Where in a pixel its samples lie, from its upper left corner.
    """

    position: Array
    rays: Array
    offsets: Array


class Surfaces(NamedTuple):
    """Triangles.

    Attributes
    ----------
    places, normals : ndarray, shape (n_vertices, 3)
        In the world [m].
    corners : ndarray, shape (n_vertices, 3)
        As the camera sees them: column and row of the picture times the distance ahead, and that
        distance [m].
    faces : ndarray of int, shape (n_faces, 3)
        Vertices of each triangle.
    materials : ndarray of int, shape (n_vertices,)
        What each vertex is made of.
    """

    places: Array
    normals: Array
    corners: Array
    faces: NDArray[np.int64]
    materials: NDArray[np.int64]


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
    directions, colours : ndarray, shape (2, 3)
        Towards two lights from afar, and how bright they are; the first, the sun, casts shadows.
    sky, ground : ndarray, shape (3,)
        Light from the left (y) and from the right, which fade into each other.
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


class Backdrop(NamedTuple):
    """The surroundings of a scene; colours are encoded as sRGB.

    Attributes
    ----------
    colour, grid : ndarray, shape (3,)
        Of the background, into which all fades, and of the lines on the floor.
    fog : ndarray, shape (2,)
        Distances at which fading begins and ends [m].
    floor_radius, grid_radius, grid_step : float
        Of the floor and of the lines on it [m]; a floor of radius 0 is none.
    line_width : float
        Of a line [pixels].
    gamma : ndarray, shape (n,)
        Encoding of linear values from 0 to 1.
    """

    colour: Array
    grid: Array
    fog: Array
    floor_radius: float
    grid_radius: float
    grid_step: float
    line_width: float
    gamma: Array


class Balls(NamedTuple):
    """Translucent balls that glow.

    Attributes
    ----------
    centres : ndarray, shape (n, 3)
        In the world [m].
    radii : ndarray, shape (n,)
        Their radii [m].
    colours : ndarray, shape (n, 3)
        Encoded as sRGB.
    opacities : ndarray, shape (n,)
        How much of what is behind they hide.
    on_top : ndarray of bool, shape (n,)
        Whether they are seen through everything.
    """

    centres: Array
    radii: Array
    colours: Array
    opacities: Array
    on_top: NDArray[np.bool_]


class View(NamedTuple):
    """All that a picture shows, for its pixels to be coloured.

    Attributes
    ----------
    eye, surfaces, materials, lights, backdrop, balls
        The scene.
    floor : ndarray of float32, shape (height, width, 2, 3)
        Colours of floor and background: in shadow, and in the sun.
    nearness : ndarray of float32, shape (height, width, n_samples)
        One over the distance ahead of what is seen at each sample [1/m].
    seen : ndarray of int32, shape (height, width, n_samples)
        Triangle that is seen there; negative for floor and background.
    """

    eye: Eye
    surfaces: Surfaces
    materials: Materials
    lights: Lights
    backdrop: Backdrop
    balls: Balls
    floor: NDArray[np.float32]
    nearness: NDArray[np.float32]
    seen: NDArray[np.int32]
