"""Pinocchio's model of an arm, and its collision shapes, from a URDF reduced to a chain."""

import numpy as np
import pinocchio as pin

from kinarm._files import first_line
from kinarm._validation import finite_array
from kinarm.errors import ArmError
from kinarm.hulls import convex_hull
from kinarm.urdf import Description


def build_model(description: Description) -> pin.Model:
    """Build the kinematics.

    Raises
    ------
    ArmError
        If Pinocchio cannot read the description, or a joint has no usable limits.
    """
    name = description.path.name
    try:
        model = pin.buildModelFromXML(description.text)
    except (ValueError, RuntimeError) as error:
        raise ArmError(f"{name} is not a readable URDF: {first_line(error)}") from error
    if model.njoints < 2:
        raise ArmError(f"{name} has no moving joint")
    for index, joint in enumerate(list(model.names)[1:]):
        lower, upper = model.lowerPositionLimit[index], model.upperPositionLimit[index]
        if not (np.isfinite(lower) and np.isfinite(upper) and lower < upper) or upper > 1e10:
            raise ArmError(f"joint {joint!r} of {name} has no usable limits: {lower}..{upper}")
    return model


def limit_velocities(
    model: pin.Model, given: tuple[float, ...] | None, description: Description
) -> None:
    """Set the velocity limits that are given, or check those of the URDF.

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
    try:
        geometry = pin.buildGeomFromUrdfString(
            model, description.text, pin.GeometryType.COLLISION, package_dirs=[]
        )
    except (ValueError, RuntimeError) as error:
        raise ArmError(
            f"collision shapes of {name} cannot be loaded: {first_line(error)}"
        ) from error
    if geometry.ngeoms != description.n_shapes:
        raise ArmError(
            f"{name} declares {description.n_shapes} collision shapes but {geometry.ngeoms} were "
            "read"
        )
    for shape in geometry.geometryObjects:
        if hasattr(shape.geometry, "buildConvexHull"):
            shape.geometry = convex_hull(shape.geometry)
        shape.geometry.computeLocalAABB()
    return geometry
