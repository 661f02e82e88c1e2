"""A picture's contents as the kernels need them, with the shapes of arrays in brackets.

Lengths are in metres and colours linear, each red, green and blue, where nothing else is said.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.compiling import Array


class Eye(NamedTuple):
    """From where a picture is seen.

    position (3,): place of the camera in the world.
    rays (3, 3): line of sight of the picture's upper left corner, as long as it gets ahead by 1,
    and what is added to it per column and per row.
    offsets (n_samples, 2): where in a pixel its samples lie, from its upper left corner.
    fog (2,): distances at which fading into the background begins and ends.
    """

    position: Array
    rays: Array
    offsets: Array
    fog: Array


class Surfaces(NamedTuple):
    """Triangles.

    places, normals (n_vertices, 3): in the world.
    corners (n_vertices, 3): vertices as the camera sees them, which are column and row of the
    picture times the distance along the line of sight, and that distance.
    faces (n_faces, 3): vertices of each triangle.
    materials (n_vertices,): row of what each vertex is made of.
    """

    places: Array
    normals: Array
    corners: Array
    faces: NDArray[np.int64]
    materials: NDArray[np.int64]


class Materials(NamedTuple):
    """Finishes of three.js' standard material, one a row; the first is the floor's.

    colour, emission (n, 3): reflected and emitted light.
    roughness, metalness (n,): in 0..1.
    reflections (n, k, k, 3): octahedral maps of the room's light, blurred as in such a mirror.
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


class View(NamedTuple):
    """All that a picture shows, for its pixels to be coloured.

    balls (n, 9): glowing balls: centre, radius, colour in sRGB, opacity, and whether it is seen
    through everything (1).
    floor (height, width, 2, 3): colours of floor and background, in shadow and in the sun.
    nearness (height, width, n_samples): one over the distance ahead of what is seen [1/m].
    seen (height, width, n_samples): triangle that is seen there; negative for the floor.
    """

    eye: Eye
    surfaces: Surfaces
    materials: Materials
    lights: Lights
    balls: Array
    floor: NDArray[np.float32]
    nearness: NDArray[np.float32]
    seen: NDArray[np.int32]
