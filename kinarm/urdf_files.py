"""Files that a robot description consists of: the URDF, installed or not, and its meshes."""

from collections.abc import Collection
from importlib import metadata
from pathlib import Path
from xml.etree import ElementTree

from kinarm._files import absolute, is_file, is_folder
from kinarm.arm_specification import PACKAGE, arm_names
from kinarm.errors import ArmError, UnknownNameError


def find_urdf(source: str) -> Path:
    """Resolve the source of a completed specification to a file.

    Raises
    ------
    ArmError
        If there is no such file.
    UnknownNameError
        If it is no path but a name.
    """
    if source.startswith(PACKAGE):
        return _installed(source)
    path = Path(source)
    if is_file(path):
        return absolute(path)
    if is_folder(path):
        raise ArmError(f"{source!r} is a folder, not a URDF")
    if path.suffix == ".urdf" or path.parent != Path():
        raise ArmError(f"URDF {source!r} does not exist")
    raise UnknownNameError("arm", source, (*arm_names(), "path/to/robot.urdf", "path/to/arm.toml"))


def _installed(source: str) -> Path:
    """Find a file of the installed package of robot descriptions."""
    name, _, inside = source.partition(":")
    try:
        package = metadata.distribution(name)
    except metadata.PackageNotFoundError:
        raise ArmError(
            f"{Path(inside).name} is part of the package {name}: pip install 'kinarm[robots]'"
        ) from None
    share = Path(str(package.locate_file(f"cmeel.prefix/share/{name}/robots")))
    if not (share / inside).is_file():
        raise ArmError(f"the package {name} {package.version} has no {inside}: another version?")
    return (share / inside).resolve()


def resolve_meshes(robot: ElementTree.Element, path: Path, folders: Collection[str]) -> None:
    """Replace names of meshes by paths; those that are missing are refused, if they can touch."""
    for use in ("collision", "visual"):
        for mesh in robot.findall(f"link/{use}/geometry/mesh"):
            name = mesh.get("filename", "")
            found = _mesh_path(name, path, folders)
            if found is not None:
                mesh.set("filename", str(found))
            elif use == "collision":
                raise ArmError(
                    f"mesh {name!r} of {path.name} is not found; package_dirs names the folders "
                    "of package:// meshes"
                )


def _mesh_path(name: str, path: Path, folders: Collection[str]) -> Path | None:
    """Find a mesh in the package folders, or in one that the URDF lies in."""
    scheme, separator, inside = name.partition("://")
    if scheme == "file":
        return Path(inside) if is_file(inside) else None
    if not separator:
        beside = path.parent / name
        return absolute(beside) if is_file(beside) else None
    around = (*map(Path, folders), *path.parents)
    own = (folder.parent for folder in around if folder.name == inside.partition("/")[0])
    for folder in (*around, *own):
        if is_file(folder / inside):
            return absolute(folder / inside)
    return None
