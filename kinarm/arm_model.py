"""Pinocchio's model of an arm, and its collision shapes, from a URDF reduced to a chain."""

from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from kinarm._files import first_line
from kinarm._validation import finite_array
from kinarm.errors import ArmError
from kinarm.meshes import hull_of_mesh
from kinarm.urdf import Description


def build_model(description: Description, speeds: tuple[float, ...] | None) -> pin.Model:
    """Build the kinematics, with these velocity limits or those of the URDF [rad/s or m/s].

    Raises ArmError if Pinocchio cannot, nothing moves, or a joint has no velocity limit.
    """
    name = description.path.name
    try:
        model = pin.buildModelFromXML(ElementTree.tostring(_robot(description), "unicode"))
    except (ValueError, RuntimeError) as error:
        raise ArmError(f"{name} is not a readable URDF: {first_line(error)}") from error
    if model.njoints < 2:
        raise ArmError(f"{name} has no moving joint")
    if speeds is not None:
        limits = finite_array("velocity_limits", speeds, (model.nv,))
        if (limits <= 0).any():
            raise ArmError(f"velocity_limits of {name} must be greater than 0, got {list(speeds)}")
        model.velocityLimit = limits
    for joint, speed in zip(list(model.names)[1:], model.velocityLimit, strict=True):
        if not 0 < speed < 1e10:
            raise ArmError(f"joint {joint!r} of {name} has no velocity limit: velocity={speed}")
    return model


def _robot(description: Description) -> Element:
    """Pinocchio's input: links with their collision shapes, and joints."""
    robot = ElementTree.fromstring(description.text)
    robot.attrib = {"name": "robot", "version": "1.2"}
    for parent in (robot, *robot):
        for element in (*parent.findall("material"), *parent.findall("visual")):
            parent.remove(element)
    return robot


def build_shapes(description: Description, model: pin.Model) -> pin.GeometryModel:
    """Load the collision shapes; meshes become convex hulls."""
    robot, hulls = _robot(description), {}
    for link in robot.findall("link"):
        for number, shape in enumerate(link.findall("collision/geometry")):
            mesh = shape.find("mesh")
            if mesh is not None:
                scale = np.array([float(factor) for factor in mesh.get("scale", "").split()])
                hull = hull_of_mesh(Path(mesh.get("filename", "")), scale)
                hulls[f"{link.get('name')}_{number}"] = hull
                shape.remove(mesh)
                ElementTree.SubElement(shape, "sphere", radius="1")
    text = ElementTree.tostring(robot, "unicode")
    geometry = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.COLLISION)
    for shape in geometry.geometryObjects:
        if shape.name in hulls:
            shape.geometry = hulls[shape.name]
        shape.geometry.computeLocalAABB()
    return geometry
