"""How an arm looks: as an industrial one where that fits, else by its own shapes."""

from functools import lru_cache

import coal
import pinocchio as pin

from kinarm.arm import Arm
from kinarm.viewer import industrial_arm
from kinarm.viewer.meshes import from_coal
from kinarm.viewer.parts import ACCENT, GRAPHITE, PAINT, ArmPart, Finish

MOST_TRIANGLES = 60_000
"""Above this, visual meshes make way for the hulls that decide contact."""

PLAIN = (GRAPHITE, PAINT)
"""Finishes of links by turns, where a robot states no colours."""

TOOL_RADIUS = 0.012


@lru_cache(maxsize=8)
def arm_parts(arm: Arm) -> tuple[ArmPart, ...]:
    """All parts of an arm.

    One with the geometry of the shipped ones looks like an industrial arm; any other shows the
    visual shapes of its URDF, or where there are none that can be read, its collision shapes.
    """
    if industrial_arm.fits(arm):
        return tuple(industrial_arm.parts(arm))
    geometry = _visual_shapes(arm)
    found = [] if geometry is None else _painted_parts(geometry)
    if not found or sum(len(part.mesh.faces) for part in found) > MOST_TRIANGLES:
        found = _plain_parts(arm.geometry)
    tool = from_coal(coal.Sphere(TOOL_RADIUS)).moved(arm.chain.tool)
    return (*found, ArmPart(arm.n_joints, ACCENT, tool))


def _visual_shapes(arm: Arm) -> pin.GeometryModel | None:
    """Visual shapes of an arm's URDF; None if they cannot be read."""
    try:
        return pin.buildGeomFromUrdf(arm.model, str(arm.urdf_path), pin.GeometryType.VISUAL)
    except (ValueError, RuntimeError):
        return None


def _painted_parts(geometry: pin.GeometryModel) -> list[ArmPart]:
    """Parts in the colours of their shapes."""
    parts = []
    for shape in geometry.geometryObjects:
        red, green, blue = (round(255 * float(value)) for value in shape.meshColor[:3])
        finish = Finish(red << 16 | green << 8 | blue, roughness=0.45, metalness=0.1)
        parts.append(_shape_part(shape, finish))
    return parts


def _plain_parts(geometry: pin.GeometryModel) -> list[ArmPart]:
    """Parts in colours of our own."""
    return [_shape_part(shape, PLAIN[shape.parentJoint % 2]) for shape in geometry.geometryObjects]


def _shape_part(shape: pin.GeometryObject, finish: Finish) -> ArmPart:
    placement, mesh = shape.placement, from_coal(shape.geometry)
    return ArmPart(shape.parentJoint, finish, mesh.moved(placement.translation, placement.rotation))
