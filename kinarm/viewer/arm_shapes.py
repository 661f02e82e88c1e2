"""The look of an arm: an industrial one if its dimensions fit, else its own shapes."""

import logging
from functools import lru_cache

import coal
import pinocchio as pin

from kinarm.arm import Arm
from kinarm.errors import KinarmError
from kinarm.viewer import industrial_arm
from kinarm.viewer.meshes import from_coal
from kinarm.viewer.parts import ACCENT, PLAIN, ArmPart
from kinarm.viewer.visual_shapes import visual_parts

TOOL_RADIUS = 0.012
"""Of the ball at the tool point; a share of the arm's reach if that is less than 1 m [m]."""


@lru_cache(maxsize=8)
def arm_parts(arm: Arm) -> tuple[ArmPart, ...]:
    """All parts of an arm.

    One with the geometry of the shipped ones looks like an industrial arm; any other shows the
    visual shapes of its URDF, or where there are none that can be read, its collision shapes. Why
    they cannot is logged as a warning, in one line.
    """
    if industrial_arm.fits(arm):
        return tuple(industrial_arm.parts(arm))
    try:
        found = tuple(visual_parts(arm))
    except KinarmError as error:
        logging.getLogger(__name__).warning(
            "%s is shown by its collision shapes: %s", arm.name, error
        )
        found = ()
    tool = from_coal(coal.Sphere(TOOL_RADIUS * min(arm.reach, 1.0))).moved(arm.chain.tool)
    return (*(found or collision_parts(arm)), ArmPart(arm.n_joints, ACCENT, tool))


def collision_parts(arm: Arm) -> tuple[ArmPart, ...]:
    """The shapes that decide about contact, in colours of our own."""
    return tuple(_shape_part(shape) for shape in arm.geometry.geometryObjects)


def _shape_part(shape: pin.GeometryObject) -> ArmPart:
    finish, placement = PLAIN[shape.parentJoint % len(PLAIN)], shape.placement
    mesh = from_coal(shape.geometry).moved(placement.translation, placement.rotation)
    return ArmPart(shape.parentJoint, finish, mesh)
