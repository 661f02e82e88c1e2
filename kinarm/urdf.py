"""Reading robot descriptions: the kinematics and collision shapes of a URDF, or why not."""

from importlib import resources
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from kinarm._files import first_line
from kinarm.arm_specification import arm_names
from kinarm.errors import ArmError, UnknownNameError


def find_urdf(source: str) -> Path:
    """Resolve a name or path to a file."""
    if source in arm_names():
        with resources.as_file(resources.files("kinarm.data") / "arms") as folder:
            return folder / f"{source}.urdf"
    path = Path(source)
    if path.is_file():
        return path.resolve()
    if path.is_dir():
        raise ArmError(f"{source!r} is a folder, not a URDF")
    if path.suffix == ".urdf" or path.parent != Path():
        raise ArmError(f"URDF {source!r} does not exist")
    raise UnknownNameError("arm", source, (*arm_names(), "path/to/robot.urdf"))


def read_urdf(path: Path, package_dirs: list[str]) -> tuple[pin.Model, pin.GeometryModel]:
    """Parse kinematics and collision shapes; meshes become convex hulls."""
    robot = _check_xml(path)
    try:
        model = pin.buildModelFromUrdf(str(path))
    except (ValueError, RuntimeError) as error:
        raise ArmError(f"{path.name} is not a readable URDF: {first_line(error)}") from error
    try:
        geometry = pin.buildGeomFromUrdf(
            model, str(path), pin.GeometryType.COLLISION, package_dirs=package_dirs
        )
    except (ValueError, RuntimeError) as error:
        raise ArmError(
            f"collision shapes of {path.name} cannot be loaded: {first_line(error)}; "
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


def check_supported(model: pin.Model, path: Path, tool_frame: str) -> int:
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
            raise ArmError(f"joint {name!r} of {path.name} has no velocity limit: velocity={speed}")
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
