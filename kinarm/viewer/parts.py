"""Parts of drawn things: meshes with a finish, carried by a joint; and colours."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm.viewer.meshes import Mesh

Array = NDArray[np.float64]

REFLECTANCE = 0.7
"""Of white lacquer; a white that reflected everything would show no shape in bright light."""


class Finish(NamedTuple):
    """A surface.

    Attributes
    ----------
    colour : int
        Red, green and blue as 0xRRGGBB.
    roughness, metalness : float
        Of three.js' standard material, in 0..1.
    opacity : float
        Less than 1 lets see through.
    glow : bool
        Whether the surface shows its colour without any light.
    """

    colour: int
    roughness: float = 0.6
    metalness: float = 0.0
    opacity: float = 1.0
    glow: bool = False


class ArmPart(NamedTuple):
    """A piece of an arm.

    Attributes
    ----------
    joint : int
        Joint that carries it; 0 is the base.
    finish : Finish
        Its surface.
    mesh : Mesh
        Its shape in the joint's frame.
    """

    joint: int
    finish: Finish
    mesh: Mesh


PAINT = Finish(0xF2B21B, roughness=0.36, metalness=0.05)
GRAPHITE = Finish(0x2E3238, roughness=0.5, metalness=0.25)
STEEL = Finish(0xC3C9D0, roughness=0.28, metalness=0.75)
ACCENT = Finish(0xE8EBEE, roughness=0.3, metalness=0.1)

PLAIN = (GRAPHITE, PAINT)
"""Finishes of links by turns, where a robot states no colours."""

OUTCOME_COLOURS = {"success": 0x0072B2, "collision": 0xD55E00, "truncated": 0xE69F00}
"""Distinguishable with any colour vision (Okabe and Ito)."""

TRACES: dict[str | None, Finish] = {
    None: Finish(0x4D5A68, roughness=0.5),
    **{outcome: Finish(colour, roughness=0.5) for outcome, colour in OUTCOME_COLOURS.items()},
}
"""Finish of the tool's way, by outcome; None while the episode goes on."""


def shape_finish(colour: int) -> Finish:
    """Surface of a visual shape of a URDF: lacquer or plastic, in a colour as 0xRRGGBB."""
    seen = to_srgb(REFLECTANCE * to_linear(channels(colour)))
    return Finish(packed_colour(seen), roughness=0.45, metalness=0.1)


def packed_colour(colour: ArrayLike) -> int:
    """Red, green and blue from 0 to 1 as 0xRRGGBB."""
    red, green, blue = (round(255 * float(value)) for value in np.clip(np.asarray(colour), 0, 1))
    return red << 16 | green << 8 | blue


def channels(colour: int) -> Array:
    """Red, green and blue of 0xRRGGBB, from 0 to 1."""
    return np.array([colour >> 16 & 255, colour >> 8 & 255, colour & 255]) / 255.0


def to_linear(encoded: ArrayLike) -> Array:
    """Decode sRGB."""
    value = np.asarray(encoded, dtype=float)
    linear: Array = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    return linear


def to_srgb(linear: ArrayLike) -> Array:
    """Encode as sRGB."""
    value = np.asarray(linear, dtype=float)
    encoded: Array = np.where(
        value <= 0.0031308, 12.92 * value, 1.055 * np.maximum(value, 0) ** (1 / 2.4) - 0.055
    )
    return encoded
