"""Robot arms: a Pinocchio model with tool, limits and collision shapes."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from kinarm._validation import finite_array
from kinarm.arm_specification import ArmSpecification
from kinarm.chain import Chain
from kinarm.errors import ArmError
from kinarm.motion_bounds import link_lengths
from kinarm.urdf import check_supported, find_urdf, read_urdf

DEFAULT_ARM = "paper"


@dataclass(frozen=True, eq=False)
class Arm:
    """A fixed-base serial chain of revolute and prismatic joints, read from a URDF.

    Build one with `Arm.load`. All arrays are read-only.

    Attributes
    ----------
    specification : ArmSpecification
        What it was made of.
    urdf_path : Path
        The file that it was read from.
    model : pinocchio.Model
        Kinematics.
    geometry : pinocchio.GeometryModel
        Collision shapes: primitives, or convex hulls of meshes; no collision pairs.
    n_actuated : int
        Joints that actions move: the first ``n_actuated`` ones; the others stay at `home`.
    home : ndarray, shape (n_joints,)
        Reference configuration [rad or m].
    chain : Chain
        The kinematics as flat arrays, for the compiled simulator.
    """

    specification: ArmSpecification
    urdf_path: Path
    model: pin.Model
    geometry: pin.GeometryModel
    n_actuated: int
    home: NDArray[np.float64]
    chain: Chain

    def __post_init__(self) -> None:
        for array in (*self.chain, self.home):
            array.flags.writeable = False

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        # Built anew, copies are read-only, too: kernels are not compiled once more for them.
        return type(self), tuple(getattr(self, item.name) for item in fields(self))

    @classmethod
    def load(cls, arm: ArmSpecification | str | Path = DEFAULT_ARM, **changes: Any) -> Arm:
        """Load a shipped arm by name, or any supported arm from a URDF file.

        Parameters
        ----------
        arm : ArmSpecification, str or Path
            ``"paper"``, ``"paper_flange"``, ``"lrmate200ic_5l"``, the path of a URDF, or a
            specification.
        **changes
            Fields of `ArmSpecification` to replace.

        Raises
        ------
        UnknownNameError
            If neither an arm nor a file of that name exists.
        ArmError
            If the file is malformed, the robot is not a fixed-base serial chain of limited
            revolute and prismatic joints with velocity limits and a tool frame, or it does not
            fit the specification.
        """
        if not isinstance(arm, ArmSpecification):
            arm = ArmSpecification(source=str(arm))
        specification = replace(arm, **changes).resolved(Path())
        path = find_urdf(specification.source)
        model, geometry = read_urdf(path, list(specification.package_dirs))
        tool_id = check_supported(model, path, specification.tool_frame)
        if specification.velocity_limits is not None:
            model.velocityLimit = _velocity_limits(specification.velocity_limits, model, path)
        chain = Chain.from_model(model, tool_id)
        loaded = cls(
            specification=specification,
            urdf_path=path,
            model=model,
            geometry=geometry,
            n_actuated=_n_actuated(specification, model, chain, path),
            home=_home(specification.home, chain),
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
        """Name of a shipped arm, or of the file without its ending."""
        return self.specification.name

    @property
    def tool_frame(self) -> str:
        """Frame whose origin is the tool point."""
        return self.specification.tool_frame

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

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, from the base to the tool."""
        return tuple(self.model.names)[1:]

    @property
    def reach(self) -> float:
        """Upper bound of the distance from the world's origin to the tool point [m]."""
        return float(link_lengths(self.chain).sum() + np.linalg.norm(self.chain.tool))

    @cached_property
    def digest(self) -> str:
        """Hash of everything that the simulator uses, to tell whether two arms behave alike."""
        arrays = [*self.chain, self.home, np.array(self.n_actuated)]
        names = []
        for shape in self.geometry.geometryObjects:
            names.append(f"{shape.name} {shape.parentJoint} {type(shape.geometry).__name__}")
            box = shape.geometry.aabb_local
            arrays += [shape.placement.homogeneous, np.array([box.min_, box.max_])]
            if isinstance(shape.geometry, coal.ConvexBase):
                arrays.append(np.array(shape.geometry.points()))
        content = hashlib.sha256("\n".join(names).encode())
        for array in arrays:
            # Adding zero removes the sign of zeros.
            content.update((np.round(np.asarray(array, dtype=float), 12) + 0.0).tobytes())
        return content.hexdigest()[:16]

    def tool_position(self, configuration: ArrayLike) -> NDArray[np.float64]:
        """Forward kinematics of the tool point, through Pinocchio.

        Parameters
        ----------
        configuration : array_like, shape (n_joints,)
            Joint positions [rad or m].

        Returns
        -------
        ndarray, shape (3,)
            Tool point in the world frame [m].
        """
        q = finite_array("configuration", configuration, (self.n_joints,))
        data = self.model.createData()
        pin.framesForwardKinematics(self.model, data, q)
        return np.array(
            data.oMf[self.model.getFrameId(self.tool_frame, pin.FrameType.BODY)].translation
        )

    def __repr__(self) -> str:
        return f"Arm({self.name!r}, {self.n_joints} axes, {self.n_actuated} actuated)"


def _trailing_idle_axes(model: pin.Model, chain: Chain) -> int:
    """Count the joints at the end of the chain that pass through the tool point."""
    point = chain.tool
    for idle, joint in enumerate(reversed(range(chain.n_joints))):
        offset = np.linalg.norm(np.cross(chain.axis[joint], point))
        if chain.prismatic[joint] or offset > 1e-9:
            return idle
        point = model.jointPlacements[joint + 1].act(point)
    return chain.n_joints


def _n_actuated(specification: ArmSpecification, model: pin.Model, chain: Chain, path: Path) -> int:
    """How many joints actions move: those named, which come first, or all that move the tool."""
    names, named = list(model.names)[1:], specification.actuated
    if named is None:
        n_actuated = chain.n_joints - _trailing_idle_axes(model, chain)
        if n_actuated == 0:
            raise ArmError(
                f"no joint of {path.name} moves the tool frame {specification.tool_frame!r}"
            )
        return n_actuated
    if not named or list(named) != names[: len(named)]:
        raise ArmError(
            f"actuated must name the first joints of {path.name} in their order, "
            f"{', '.join(names)}; got {', '.join(named) or 'none'}"
        )
    return len(named)


def _velocity_limits(given: tuple[float, ...], model: pin.Model, path: Path) -> NDArray[np.float64]:
    """Check velocity limits that replace those of the URDF."""
    limits = finite_array("velocity_limits", given, (model.nv,))
    if (limits <= 0).any():
        raise ArmError(f"velocity_limits of {path.name} must be greater than 0, got {list(given)}")
    return limits


def _home(home: ArrayLike | None, chain: Chain) -> NDArray[np.float64]:
    """Check a home configuration, or take zero clipped to the limits."""
    given = finite_array(
        "home", np.zeros(chain.n_joints) if home is None else home, (chain.n_joints,)
    )
    clipped: NDArray[np.float64] = np.clip(given, chain.lower, chain.upper)
    if home is not None and not np.array_equal(given, clipped):
        raise ArmError(f"home {given.tolist()} lies outside the limits")
    return clipped
