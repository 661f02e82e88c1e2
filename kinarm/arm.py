"""Robot arms: a Pinocchio model with tool, limits and collision shapes."""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from kinarm._files import first_line
from kinarm.arm_specification import AllowedContact, ArmSpecification
from kinarm.bodies import HeldBody
from kinarm.chain import Chain, length_of, link_lengths
from kinarm.errors import ArmError, finite_array
from kinarm.meshes import coal_shape, hulls_of_mesh
from kinarm.urdf import Description, read_urdf


@dataclass(frozen=True, eq=False)
class Arm:
    """A fixed-base chain of revolute and prismatic joints in series, read from a URDF.

    Build one with `Arm.load`. All arrays are read-only.

    Attributes
    ----------
    specification, description : ArmSpecification and Description
        What it was made of, and the URDF, reduced to the tool's chain.
    model, geometry : pinocchio.Model and pinocchio.GeometryModel
        Kinematics, and collision shapes: primitives, or convex hulls or pieces of
        meshes; no pairs.
    n_actuated : int
        Joints, the first ones, that actions move; the others stay at `home`.
    home : ndarray, shape (n_joints,)
        Reference configuration [rad or m].
    held_bodies : tuple of HeldBody
        What links hold; the last ones of the collision shapes.
    allowed_contacts : tuple of AllowedContact
        Links or held bodies that may touch.
    chain : Chain
        The kinematics as flat arrays, for the compiled simulator.
    unplaced : Arm or None
        The same arm at the origin, if it stands elsewhere.
    """

    specification: ArmSpecification
    description: Description
    model: pin.Model
    geometry: pin.GeometryModel
    n_actuated: int
    home: NDArray[np.float64]
    held_bodies: tuple[HeldBody, ...]
    allowed_contacts: tuple[AllowedContact, ...]
    chain: Chain
    unplaced: "Arm | None" = None

    def __post_init__(self) -> None:
        for array in (*self.chain, self.home):
            array.flags.writeable = False

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        # Built anew, copies are read-only: kernels are not compiled once more for them.
        return type(self), tuple(getattr(self, item.name) for item in fields(self))

    @classmethod
    def load(cls, arm: ArmSpecification | str | Path = "paper", **changes: Any) -> "Arm":
        """Load an arm by name, or any supported arm from a URDF or an arm file.

        Parameters
        ----------
        arm : ArmSpecification, str or Path
            A name of `arm_names`, such as ``"ur5"``, a path of a URDF or arm
            file, or a specification.
        **changes
            Fields of `ArmSpecification` to replace.

        Raises
        ------
        UnknownNameError, ArmError
            If there is no such arm or file, the robot is not a tree on a fixed
            base whose tool is carried by limited joints with velocity limits,
            or it does not fit the specification.
        """
        if not isinstance(arm, ArmSpecification):
            arm = ArmSpecification(source=str(arm))
        specification = replace(arm, **changes).resolved(Path())
        wanted = specification.completed()
        description = read_urdf(wanted)
        model = _build_model(description, wanted.velocity_limits)
        chain = Chain.from_model(model, description.tool_frame)
        home = np.clip(np.zeros(chain.n_joints), chain.lower, chain.upper)
        if wanted.home is not None:
            home = finite_array("home", wanted.home, home.shape)
            home = chain.within_limits("home", home, tuple(model.names)[1:])
        loaded = cls(
            specification=specification,
            description=description,
            model=model,
            geometry=_build_shapes(description, model, wanted),
            n_actuated=_n_actuated(wanted.actuated, model, chain, description),
            home=home,
            held_bodies=wanted.held_bodies or (),
            allowed_contacts=wanted.allowed_contacts or (),
            chain=chain,
        )
        if specification.digest not in (None, loaded.digest):
            raise ArmError(
                f"arm {loaded.name!r} is another version ({loaded.digest}) than the one that was "
                f"used ({specification.digest})"
            )
        return loaded

    @property
    def name(self) -> str:
        """Name of a shipped arm, or stem of the file."""
        return self.specification.name

    @property
    def tool_frame(self) -> str:
        """Frame whose origin is the tool point."""
        return self.description.tool_frame

    def placed(self, position: ArrayLike, rotation: ArrayLike) -> "Arm":
        """The same arm with its base elsewhere.

        Parameters
        ----------
        position : array_like, shape (3,)
            Origin of the base in the world [m].
        rotation : array_like, shape (3, 3)
            Orientation of the base in the world.
        """
        base = pin.SE3(np.asarray(rotation, dtype=float), np.asarray(position, dtype=float))
        if base.isIdentity(0.0):
            return self
        model, geometry = self.model.copy(), self.geometry.copy()
        model.jointPlacements[1] = base * model.jointPlacements[1]
        for part in (*model.frames, *geometry.geometryObjects):
            if part.parentJoint == 0:
                part.placement = base * part.placement
        chain = Chain.from_model(model, self.tool_frame)
        return replace(self, model=model, geometry=geometry, chain=chain, unplaced=self)

    @property
    def meshes(self) -> pin.GeometryModel:
        """Its collision shapes with meshes as they are."""
        return _geometry(_robot(self.description), self.model, self.held_bodies)

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return self.chain.n_joints

    @property
    def lower(self) -> NDArray[np.float64]:
        """Lower limits of the joints, shape (n_joints,) [rad or m]."""
        return self.chain.lower

    @property
    def upper(self) -> NDArray[np.float64]:
        """Upper limits of the joints, shape (n_joints,) [rad or m]."""
        return self.chain.upper

    @property
    def velocity_limits(self) -> NDArray[np.float64]:
        """Velocity limits of the joints, shape (n_joints,) [rad/s or m/s]."""
        return self.chain.velocity_limits

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, from the base to the tool."""
        return tuple(self.model.names)[1:]

    @property
    def reach(self) -> float:
        """Bound on the distance from the world's origin to the tool point [m]."""
        return float(link_lengths(self.chain).sum() + length_of(self.chain.tool))

    @cached_property
    def digest(self) -> str:
        """Hash of all that the simulator uses, except where the base stands."""
        if self.unplaced is not None:
            return self.unplaced.digest
        arrays = [*self.chain, self.home, np.array(self.n_actuated)]
        names = []
        for shape in self.geometry.geometryObjects:
            names.append(f"{shape.name} {shape.parentJoint} {type(shape.geometry).__name__}")
            box = shape.geometry.aabb_local
            arrays += [shape.placement.homogeneous, np.array([box.min_, box.max_])]
            if isinstance(shape.geometry, coal.ConvexBase):
                arrays.append(np.array(shape.geometry.points()))
        links = sorted(tuple(sorted(each.links)) for each in self.allowed_contacts)
        names += [f"{first} may touch {second}" for first, second in links]
        content = hashlib.sha256("\n".join(names).encode())
        for array in arrays:
            # Adding zero removes the sign of zeros.
            content.update((np.round(np.asarray(array, dtype=float), 12) + 0.0).tobytes())
        return content.hexdigest()[:16]

    def tool_position(self, configuration: ArrayLike) -> NDArray[np.float64]:
        """Forward kinematics of the tool point, through Pinocchio.

        Maps a configuration, shape (n_joints,) [rad or m], to the world frame, shape (3,) [m].
        """
        q = finite_array("configuration", configuration, (self.n_joints,))
        data, frame = self.model.createData(), self.model.getFrameId(self.tool_frame, pin.BODY)
        pin.framesForwardKinematics(self.model, data, q)
        return np.array(data.oMf[frame].translation)

    def __repr__(self) -> str:
        return f"Arm({self.name!r}, {self.n_joints} axes, {self.n_actuated} actuated)"


def _build_model(description: Description, speeds: tuple[float, ...] | None) -> pin.Model:
    """Build the kinematics, with these velocity limits or those of the URDF [rad/s or m/s].

    Raises ArmError if Pinocchio cannot, nothing moves, or a velocity limit is missing.
    """
    name = description.path.name
    try:
        model = pin.buildModelFromXML(ElementTree.tostring(_robot(description), "unicode"))
    except (ValueError, RuntimeError) as error:
        raise ArmError(f"{name}: not a readable URDF: {first_line(error)}") from error
    if model.njoints < 2:
        raise ArmError(f"{name}: no moving joint")
    if speeds is not None:
        model.velocityLimit = finite_array("velocity_limits", speeds, (model.nv,))
    for joint, speed in zip(list(model.names)[1:], model.velocityLimit, strict=True):
        if not 0 < speed < 1e10:
            raise ArmError(f"{name}: joint {joint!r} has no velocity limit: velocity={speed}")
    return model


def _robot(description: Description) -> ElementTree.Element:
    """Pinocchio's input: links, collision shapes and joints."""
    robot = ElementTree.fromstring(description.text)
    robot.attrib = {"name": "robot", "version": "1.2"}
    for parent in (robot, *robot):
        for element in (*parent.findall("material"), *parent.findall("visual")):
            parent.remove(element)
    return robot


def _geometry(
    robot: ElementTree.Element, model: pin.Model, held_bodies: Iterable[HeldBody]
) -> pin.GeometryModel:
    """Collision shapes of a URDF, and what its links hold."""
    text = ElementTree.tostring(robot, "unicode")
    geometry = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.COLLISION)
    for body in held_bodies:
        link = model.frames[model.getFrameId(body.link, pin.BODY)]
        placement = link.placement * pin.SE3(body.rotation, np.array(body.position))
        shape = (f"{body.name}_0", link.parentJoint, placement, coal_shape(body))
        geometry.addGeometryObject(pin.GeometryObject(*shape))
    return geometry


def _build_shapes(
    description: Description, model: pin.Model, wanted: ArmSpecification
) -> pin.GeometryModel:
    """Load the collision shapes; meshes become convex hulls, or some links' pieces."""
    robot, hulls, pieces = _robot(description), dict[str, coal.ConvexBase](), wanted.pieces or {}
    for link in robot.findall("link"):
        name, number = link.get("name", ""), 0
        for collision in link.findall("collision"):
            link.remove(collision)
            mesh, found = collision.find("geometry/mesh"), list[coal.ConvexBase]()
            if mesh is not None:
                scale = np.array([float(factor) for factor in mesh.attrib["scale"].split()])
                found = hulls_of_mesh(Path(mesh.attrib["filename"]), scale, pieces.get(name, 1))
                mesh.tag, mesh.attrib = "sphere", {"radius": "1"}
            for hull in found or [None]:
                link.append(collision)
                if hull is not None:
                    hulls[f"{name}_{number}"] = hull
                number += 1
    geometry = _geometry(robot, model, wanted.held_bodies or ())
    for shape in geometry.geometryObjects:
        if shape.name in hulls:
            shape.geometry = hulls[shape.name]
        shape.geometry.computeLocalAABB()
    return geometry


def _trailing_idle_axes(model: pin.Model, chain: Chain) -> int:
    """Number of last joints whose axes pass through the tool point."""
    point = chain.tool
    for idle, joint in enumerate(reversed(range(chain.n_joints))):
        offset = np.linalg.norm(np.cross(chain.axis[joint], point))
        if chain.prismatic[joint] or offset > 1e-9:
            return idle
        point = model.jointPlacements[joint + 1].act(point)
    return chain.n_joints


def _n_actuated(
    named: tuple[str, ...] | None, model: pin.Model, chain: Chain, description: Description
) -> int:
    """Number of actuated joints: those named, all, or by default all that move the tool."""
    names = list(model.names)[1:]
    if named == ():
        return chain.n_joints
    if named is None:
        n_actuated = chain.n_joints - _trailing_idle_axes(model, chain)
        if n_actuated == 0:
            raise ArmError(
                f"no joint of {description.path.name} moves the tool frame "
                f"{description.tool_frame!r}"
            )
        return n_actuated
    if list(named) != names[: len(named)]:
        raise ArmError(
            f"actuated must name the first joints of {description.path.name} in their order, "
            f"{', '.join(names)}; got {', '.join(named)} (held locks others)"
        )
    return len(named)
