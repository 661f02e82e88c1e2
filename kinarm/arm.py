"""Robot arms: a Pinocchio model with tool, limits, rated speeds and collision shapes."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import resources
from pathlib import Path
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from kinarm.chain import Chain
from kinarm.errors import ArmError, UnknownNameError
from kinarm.motion_bounds import link_lengths
from kinarm.validation import finite_array

DEFAULT_ARM = "paper"
TOOL_FRAME = "tool0"


def arm_names() -> tuple[str, ...]:
    """Names of the arms that ship with kinarm."""
    folder = resources.files("kinarm.data") / "arms"
    return tuple(sorted(Path(f.name).stem for f in folder.iterdir() if f.name.endswith(".urdf")))


@dataclass(frozen=True, eq=False)
class Arm:
    """A fixed-base serial chain of revolute and prismatic joints, read from a URDF.

    Build one with `Arm.load`. All arrays are read-only.

    Attributes
    ----------
    name : str
        Name of the arm: that of a shipped one, or of the file without its ending.
    urdf_path : Path
        The file that it was read from.
    model : pinocchio.Model
        Kinematics.
    geometry : pinocchio.GeometryModel
        Collision shapes: primitives, or convex hulls of meshes; no collision pairs.
    tool_frame : str
        Frame whose origin is the tool point.
    n_actuated : int
        Axes that actions move: the first ``n_actuated`` ones; the others stay at `home`.
    home : ndarray, shape (n_axes,)
        Reference configuration [rad or m].
    chain : Chain
        The kinematics as flat arrays, for the compiled simulator.
    """

    name: str
    urdf_path: Path
    model: pin.Model
    geometry: pin.GeometryModel
    tool_frame: str
    n_actuated: int
    home: NDArray[np.float64]
    chain: Chain

    @classmethod
    def load(
        cls,
        name_or_urdf: str | Path = DEFAULT_ARM,
        *,
        tool_frame: str = TOOL_FRAME,
        n_actuated: int | None = None,
        home: ArrayLike | None = None,
        package_dirs: Sequence[str | Path] = (),
    ) -> "Arm":
        """Load a shipped arm by name, or any supported arm from a URDF file.

        Parameters
        ----------
        name_or_urdf : str or Path
            ``"paper"``, ``"paper_flange"``, ``"lrmate200ic_5l"``, or the path of a URDF.
        tool_frame : str
            Link (frame) whose origin is the tool point.
        n_actuated : int, optional
            How many axes, counted from the base, actions move. By default all but the trailing
            axes that cannot move the tool point: the paper holds axis 6 for that reason.
        home : array_like, shape (n_axes,), optional
            Reference configuration; zero, clipped to the limits, by default.
        package_dirs : sequence of paths
            Folders that hold the packages which ``package://`` mesh names refer to.

        Raises
        ------
        UnknownNameError
            If neither an arm nor a file of that name exists.
        ArmError
            If the file is malformed or the robot is not a fixed-base serial chain of limited
            revolute and prismatic joints with rated speeds and a tool frame.
        """
        path, name = _find_urdf(name_or_urdf)
        model, geometry = _read_urdf(path, [str(folder) for folder in package_dirs])
        tool_id = _check_supported(model, path, tool_frame)
        chain = Chain.from_model(model, tool_id)
        if n_actuated is None:
            n_actuated = chain.n_axes - _trailing_idle_axes(model, chain)
            if n_actuated == 0:
                raise ArmError(f"no axis of {path.name} moves the tool frame {tool_frame!r}")
        if n_actuated not in range(1, chain.n_axes + 1) or not isinstance(n_actuated, int):
            raise ArmError(
                f"n_actuated must be a whole number in 1..{chain.n_axes}, got {n_actuated}"
            )
        return cls(
            name=name or path.stem,
            urdf_path=path,
            model=model,
            geometry=geometry,
            tool_frame=tool_frame,
            n_actuated=n_actuated,
            home=_home(home, chain),
            chain=chain,
        )

    @property
    def n_axes(self) -> int:
        """Number of joints."""
        return self.chain.n_axes

    @property
    def lower(self) -> NDArray[np.float64]:
        """Lower limits of the axes, shape (n_axes,) [rad or m]."""
        return self.chain.lower

    @property
    def upper(self) -> NDArray[np.float64]:
        """Upper limits of the axes, shape (n_axes,) [rad or m]."""
        return self.chain.upper

    @property
    def speed(self) -> NDArray[np.float64]:
        """Rated speeds of the axes, shape (n_axes,) [rad/s or m/s]."""
        return self.chain.speed

    @property
    def axis_names(self) -> tuple[str, ...]:
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
        configuration : array_like, shape (n_axes,)
            Axis positions [rad or m].

        Returns
        -------
        ndarray, shape (3,)
            Tool point in the world frame [m].
        """
        q = finite_array("configuration", configuration, (self.n_axes,))
        data = self.model.createData()
        pin.framesForwardKinematics(self.model, data, q)
        return np.array(
            data.oMf[self.model.getFrameId(self.tool_frame, pin.FrameType.BODY)].translation
        )

    def __repr__(self) -> str:
        return f"Arm({self.name!r}, {self.n_axes} axes, {self.n_actuated} actuated)"


def _find_urdf(name_or_urdf: str | Path) -> tuple[Path, str | None]:
    """Resolve a name or path to a file, and the shipped arm's name if it is one."""
    if isinstance(name_or_urdf, str) and name_or_urdf in arm_names():
        with resources.as_file(resources.files("kinarm.data") / "arms") as folder:
            return folder / f"{name_or_urdf}.urdf", name_or_urdf
    path = Path(name_or_urdf)
    if path.is_file():
        return path.resolve(), None
    if path.is_dir():
        raise ArmError(f"{str(path)!r} is a folder, not a URDF")
    if path.suffix == ".urdf" or path.parent != Path():
        raise ArmError(f"URDF {str(path)!r} does not exist")
    raise UnknownNameError("arm", str(name_or_urdf), (*arm_names(), "path/to/robot.urdf"))


def _read_urdf(path: Path, package_dirs: list[str]) -> tuple[pin.Model, pin.GeometryModel]:
    """Parse kinematics and collision shapes; meshes become convex hulls."""
    robot = _check_xml(path)
    try:
        model = pin.buildModelFromUrdf(str(path))
    except (ValueError, RuntimeError) as error:
        raise ArmError(f"{path.name} is not a readable URDF: {_first_line(error)}") from error
    try:
        geometry = pin.buildGeomFromUrdf(
            model, str(path), pin.GeometryType.COLLISION, package_dirs=package_dirs
        )
    except (ValueError, RuntimeError) as error:
        raise ArmError(
            f"collision shapes of {path.name} cannot be loaded: {_first_line(error)}; "
            "package_dirs names the folders of package:// meshes"
        ) from error
    declared = len(robot.findall("link/collision"))
    if geometry.ngeoms != declared:
        raise ArmError(
            f"{path.name} declares {declared} collision shapes but {geometry.ngeoms} were read; "
            'capsules need <robot version="1.2">'
        )
    for shape in geometry.geometryObjects:
        if hasattr(shape.geometry, "buildConvexHull"):
            shape.geometry.buildConvexHull(True, "Qt")
            shape.geometry = shape.geometry.convex
        shape.geometry.computeLocalAABB()
    return model, geometry


def _check_xml(path: Path) -> ElementTree.Element:
    """Parse the file and refuse joints that Pinocchio would drop or take for independent."""
    try:
        robot = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, OSError, UnicodeError) as error:
        raise ArmError(f"{path.name} is not a readable URDF: {error}") from error
    if robot.tag != "robot":
        raise ArmError(
            f"{path.name} is not a readable URDF: its root is <{robot.tag}>, not <robot>"
        )
    capsules = robot.find("link/collision/geometry/capsule") is not None
    if capsules and robot.get("version", "1.0") not in ("1.1", "1.2"):
        raise ArmError(f'{path.name} has capsules, which need <robot version="1.2">')
    for joint in robot.findall("joint"):
        name, kind = joint.get("name"), joint.get("type")
        if joint.find("mimic") is not None:
            raise ArmError(f"joint {name!r} of {path.name} mimics another one: not supported")
        if kind in ("revolute", "prismatic") and joint.find("limit") is None:
            raise ArmError(f"joint {name!r} of {path.name} has no limits")
    return robot


def _first_line(error: Exception) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[0]


def _check_supported(model: pin.Model, path: Path, tool_frame: str) -> int:
    """Refuse what the simulator cannot represent; return the id of the tool frame."""
    names = list(model.names)
    if model.njoints < 2:
        raise ArmError(f"{path.name} has no moving joint")
    for index in range(1, model.njoints):
        joint, name = model.joints[index], names[index]
        kind = joint.shortname()
        if "FreeFlyer" in kind or "Planar" in kind:
            raise ArmError(f"joint {name!r} of {path.name} is {kind}: the base must be fixed")
        if "RUB" in kind or "RevoluteUnbounded" in kind:
            raise ArmError(f"joint {name!r} of {path.name} is continuous: give it limits")
        if joint.nq != 1 or joint.nv != 1:
            raise ArmError(f"joint {name!r} of {path.name} is {kind}: only revolute and prismatic")
        if model.parents[index] != index - 1:
            raise ArmError(
                f"{path.name} branches at joint {name!r}: only a serial chain is supported"
            )
        lower = model.lowerPositionLimit[index - 1]
        upper = model.upperPositionLimit[index - 1]
        if not (np.isfinite(lower) and np.isfinite(upper) and lower < upper) or upper > 1e10:
            raise ArmError(f"joint {name!r} of {path.name} has no usable limits: {lower}..{upper}")
        speed = model.velocityLimit[index - 1]
        if not (np.isfinite(speed) and 0 < speed < 1e10):
            raise ArmError(f"joint {name!r} of {path.name} has no rated speed: velocity={speed}")
    if not model.existFrame(tool_frame, pin.FrameType.BODY):
        frames = [frame.name for frame in model.frames if frame.type == pin.FrameType.BODY]
        raise ArmError(
            f"{path.name} has no tool frame {tool_frame!r}; tool_frame can be one of its links: "
            + ", ".join(frames)
        )
    tool_id = int(model.getFrameId(tool_frame, pin.FrameType.BODY))
    if model.frames[tool_id].parentJoint != model.njoints - 1:
        raise ArmError(f"tool frame {tool_frame!r} of {path.name} is not on the last moving link")
    return tool_id


def _trailing_idle_axes(model: pin.Model, chain: Chain) -> int:
    """Count the axes at the end of the chain that pass through the tool point."""
    point = chain.tool
    for idle, joint in enumerate(reversed(range(chain.n_axes))):
        offset = np.linalg.norm(np.cross(chain.axis[joint], point))
        if chain.prismatic[joint] or offset > 1e-9:
            return idle
        point = model.jointPlacements[joint + 1].act(point)
    return chain.n_axes


def _home(home: ArrayLike | None, chain: Chain) -> NDArray[np.float64]:
    """Check a home configuration, or take zero clipped to the limits."""
    given = finite_array("home", np.zeros(chain.n_axes) if home is None else home, (chain.n_axes,))
    clipped: NDArray[np.float64] = np.clip(given, chain.lower, chain.upper)
    if home is not None and not np.array_equal(given, clipped):
        raise ArmError(f"home {given.tolist()} lies outside the limits")
    clipped.flags.writeable = False
    return clipped
