"""Pinocchio's model of an arm, and its collision shapes, from a URDF reduced to a chain."""

from collections.abc import Collection
from pathlib import Path
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin

from kinarm._files import first_line
from kinarm._validation import finite_array
from kinarm.errors import ArmError
from kinarm.meshes import hull_of_mesh
from kinarm.urdf import Description


def build_model(description: Description) -> pin.Model:
    """Build the kinematics.

    Raises
    ------
    ArmError
        If Pinocchio cannot read the description, or nothing moves.
    """
    name = description.path.name
    try:
        model = pin.buildModelFromXML(_kinematics(description, ()))
    except (ValueError, RuntimeError) as error:
        raise ArmError(f"{name} is not a readable URDF: {first_line(error)}") from error
    if model.njoints < 2:
        raise ArmError(f"{name} has no moving joint")
    return model


def _kinematics(description: Description, shapes: Collection[str]) -> str:
    """Pinocchio's input: links with some of their shapes, and joints."""
    robot = ElementTree.fromstring(description.text)
    robot.attrib = {"name": "robot", "version": "1.2"}
    for part in robot.findall("material"):
        robot.remove(part)
    for link in robot.findall("link"):
        for shape in [shape for shape in link if shape.tag not in shapes]:
            link.remove(shape)
    return ElementTree.tostring(robot, encoding="unicode")


def limit_velocities(
    model: pin.Model, given: tuple[float, ...] | None, description: Description
) -> None:
    """Set the given velocity limits, or check those of the URDF.

    Parameters
    ----------
    model : pinocchio.Model
        The model whose limits are set.
    given : tuple of float, optional
        Velocity limits of all joints [rad/s or m/s].
    description : Description
        The URDF.

    Raises
    ------
    ArmError
        If one is missing or not above zero.
    """
    name = description.path.name
    if given is not None:
        limits = finite_array("velocity_limits", given, (model.nv,))
        if (limits <= 0).any():
            raise ArmError(f"velocity_limits of {name} must be greater than 0, got {list(given)}")
        model.velocityLimit = limits
    for joint, speed in zip(list(model.names)[1:], model.velocityLimit, strict=True):
        if not (np.isfinite(speed) and 0 < speed < 1e10):
            raise ArmError(f"joint {joint!r} of {name} has no velocity limit: velocity={speed}")


def build_shapes(description: Description, model: pin.Model) -> pin.GeometryModel:
    """Load the collision shapes; meshes become convex hulls.

    Raises
    ------
    ArmError
        If a shape cannot be loaded.
    """
    name = description.path.name
    robot = ElementTree.fromstring(_kinematics(description, ("collision",)))
    hulls, declared = {}, 0
    for link in robot.findall("link"):
        for number, shape in enumerate(link.findall("collision/geometry")):
            declared += 1
            mesh = shape.find("mesh")
            if mesh is not None:
                hulls[f"{link.get('name')}_{number}"] = _hull(mesh)
                shape.remove(mesh)
                ElementTree.SubElement(shape, "sphere", radius="1")
    text = ElementTree.tostring(robot, encoding="unicode")
    try:
        geometry = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.COLLISION)
    except (ValueError, RuntimeError) as error:
        raise ArmError(
            f"collision shapes of {name} cannot be loaded: {first_line(error)}"
        ) from error
    if geometry.ngeoms != declared:
        raise ArmError(
            f"{name} declares {declared} collision shapes but {geometry.ngeoms} were read"
        )
    for shape in geometry.geometryObjects:
        if shape.name in hulls:
            shape.geometry = hulls[shape.name]
        shape.geometry.computeLocalAABB()
    return geometry


def _hull(mesh: ElementTree.Element) -> coal.ConvexBase:
    """Hull of a mesh of a description."""
    scale = np.array([float(factor) for factor in mesh.get("scale", "1 1 1").split()])
    return hull_of_mesh(Path(mesh.get("filename", "")), finite_array("scale", scale, (3,)))
