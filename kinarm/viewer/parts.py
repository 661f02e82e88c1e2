"""What drawn things are made of: meshes with a finish, carried by a joint."""

from typing import NamedTuple

from kinarm.viewer.meshes import Mesh


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
