"""Colours of robots' meshes, and the finishes that they stand for."""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm.viewer.lighting import channels, to_linear, to_srgb
from kinarm.viewer.parts import Finish

UNIVERSAL_ROBOTS = np.array(
    [(0.49, 0.678, 0.8), (0.82, 0.82, 0.82), (0.279, 0.279, 0.279), (0.58, 0.58, 0.58), (0.1,) * 3]
)
"""Colours of the maker's caps, links, joints, rims and seals."""

DIMMING, MOST_TIMES = 0.8, 6
"""The meshes in ``ur_description`` went through a modeller a few times, each of which left them
this share of their light; links that went through it more often than others look darker."""

SAME_COLOUR = 0.003

REFLECTANCE = 0.7
"""Of white lacquer; a white that reflected everything would show no shape in bright light."""


def shape_finish(colour: int) -> Finish:
    """Surface of a visual shape of a URDF: lacquer or plastic, in a colour as 0xRRGGBB."""
    seen = to_srgb(REFLECTANCE * to_linear(channels(colour)))
    return Finish(packed_colour(seen), roughness=0.45, metalness=0.1)


def packed_colour(colour: ArrayLike) -> int:
    """Red, green and blue from 0 to 1 as 0xRRGGBB."""
    red, green, blue = (round(255 * float(value)) for value in np.clip(np.asarray(colour), 0, 1))
    return red << 16 | green << 8 | blue


def original_colour(path: Path, colour: NDArray[np.float64]) -> NDArray[np.float64]:
    """Colour of a part as its maker made it, shape (3,), for one that a mesh file states."""
    if "ur_description" in path.parts:
        for times in range(MOST_TIMES + 1):
            apart = np.abs(UNIVERSAL_ROBOTS * DIMMING**times - colour).max(axis=1)
            if apart.min() < SAME_COLOUR:
                original: NDArray[np.float64] = UNIVERSAL_ROBOTS[apart.argmin()]
                return original
    return colour
