"""The same arm and scene for MuJoCo, as MJCF."""

from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from kinarm.world import World

STIFFNESS, DAMPING = 10_000.0, 400.0
"""Of the joints' position servos, which hold a mass of 1 kg a link and an armature of 1 kg m2."""


def mjcf(world: World, time_step: float) -> str:
    """Describe a world: joints, limits, shapes, and the pairs of bodies that may touch.

    Joints that actions do not move are left out, at home. The others are driven by position
    servos. There is no gravity, so that the servos have nothing to hold against.

    Parameters
    ----------
    world : World
        Arm and scene.
    time_step : float
        Duration of a step [s].
    """
    root = Element("mujoco", model=world.arm.name)
    SubElement(root, "option", timestep=repr(time_step), gravity="0 0 0", integrator="implicitfast")
    SubElement(root, "compiler", angle="radian", autolimits="true", boundmass="0.001")
    assets, world_body = SubElement(root, "asset"), SubElement(root, "worldbody")
    bodies = {0: SubElement(world_body, "body", name=body_name(0))}
    _add_chain(world, bodies)
    n_shapes = world.arm.geometry.ngeoms
    for index, shape in enumerate(world.contact_model.geometry.geometryObjects):
        body = bodies[shape.parentJoint] if index < n_shapes else world_body
        _add_shape(shape, f"shape{index}", body, assets)
    _exclude_untested(world, SubElement(root, "contact"))
    actuators, chain = SubElement(root, "actuator"), world.arm.chain
    for k in range(world.n_actions):
        limits = _numbers((chain.lower[k], chain.upper[k]))
        servo = {"kp": repr(STIFFNESS), "kv": repr(DAMPING), "ctrlrange": limits}
        SubElement(actuators, "position", {"joint": joint_name(k), **servo})
    return ElementTree.tostring(root, encoding="unicode")


def body_name(joint: int) -> str:
    """Name of the body that a joint carries; 0 is the base."""
    return f"link{joint}"


def joint_name(index: int) -> str:
    """Name of a joint."""
    return f"joint{index + 1}"


def _add_chain(world: World, bodies: dict[int, Element]) -> None:
    """Add the links, each within the one before."""
    arm = world.arm
    data = arm.model.createData()
    pin.forwardKinematics(arm.model, data, arm.home)
    for k in range(arm.n_joints):
        moves = k < arm.n_actuated
        placement = arm.model.jointPlacements[k + 1] if moves else data.liMi[k + 1]
        body = SubElement(bodies[k], "body", {"name": body_name(k + 1), **_pose(placement)})
        SubElement(body, "inertial", pos="0 0 0", mass="1", diaginertia="0.01 0.01 0.01")
        if moves:
            SubElement(
                body,
                "joint",
                name=joint_name(k),
                type="slide" if arm.chain.prismatic[k] else "hinge",
                axis=_numbers(arm.chain.axis[k]),
                range=_numbers((arm.chain.lower[k], arm.chain.upper[k])),
                armature="1",
            )
        bodies[k + 1] = body


def _add_shape(shape: pin.GeometryObject, name: str, body: Element, assets: Element) -> None:
    """Add a collision shape to a body."""
    solid, pose = shape.geometry, _pose(shape.placement)
    if isinstance(solid, coal.Capsule):
        size = {"type": "capsule", "size": _numbers((solid.radius, solid.halfLength))}
    elif isinstance(solid, coal.Cylinder):
        size = {"type": "cylinder", "size": _numbers((solid.radius, solid.halfLength))}
    elif isinstance(solid, coal.Sphere):
        size = {"type": "sphere", "size": repr(float(solid.radius))}
    elif isinstance(solid, coal.Box):
        size = {"type": "box", "size": _numbers(solid.halfSide)}
    elif isinstance(solid, coal.Halfspace):
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), np.array(solid.n))
        plane = shape.placement * pin.SE3(turn.matrix(), solid.d * np.array(solid.n))
        size, pose = {"type": "plane", "size": "0 0 1"}, _pose(plane)
    else:
        SubElement(assets, "mesh", name=name, vertex=_numbers(np.ravel(solid.points())))
        size = {"type": "mesh", "mesh": name}
    SubElement(body, "geom", {"name": name, **size, **pose})


def _exclude_untested(world: World, contact: Element) -> None:
    """Exclude pairs of bodies of which no shapes are tested."""
    geometry, n_shapes = world.contact_model.geometry, world.arm.geometry.ngeoms
    names = [
        body_name(shape.parentJoint) if index < n_shapes else "world"
        for index, shape in enumerate(geometry.geometryObjects)
    ]
    tested = {frozenset((names[p.first], names[p.second])) for p in geometry.collisionPairs}
    there = ["world", *(body_name(k) for k in range(world.arm.n_joints + 1))]
    for index, first in enumerate(there):
        for second in there[index + 1 :]:
            if frozenset((first, second)) not in tested:
                SubElement(contact, "exclude", body1=first, body2=second)


def _pose(placement: pin.SE3) -> dict[str, str]:
    """Attributes of a placement."""
    x, y, z, w = pin.Quaternion(placement.rotation).coeffs()
    return {"pos": _numbers(placement.translation), "quat": _numbers((w, x, y, z))}


def _numbers(values: ArrayLike) -> str:
    """Numbers with all their digits."""
    vector: NDArray[np.float64] = np.asarray(values, dtype=float)
    return " ".join(repr(float(value)) for value in vector)
