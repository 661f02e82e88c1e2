"""Which arm: its name or file and what of it is used, without the libraries that read it."""

from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path

from kinarm._fields import check_fields


def arm_names() -> tuple[str, ...]:
    """Names of the arms that ship with kinarm."""
    folder = resources.files("kinarm.data") / "arms"
    return tuple(sorted(Path(f.name).stem for f in folder.iterdir() if f.name.endswith(".urdf")))


@dataclass(frozen=True, kw_only=True)
class ArmSpecification:
    """Which arm, and what of it the simulator is to use.

    Parameters
    ----------
    source : str
        Name of a shipped arm, or path of a URDF.
    tool_frame : str
        Link (frame) whose origin is the tool point.
    package_dirs : tuple of str
        Folders that hold the packages which ``package://`` mesh names refer to.
    actuated : tuple of str
        Names of the joints that actions move, from the base on; by default all but the trailing
        ones that cannot move the tool point. The others stay at home.
    home : tuple of float
        Reference configuration; zero, clipped to the limits, by default [rad or m].
    velocity_limits : tuple of float
        Limits to use instead of the URDF's [rad/s or m/s].
    digest : str
        Hash that the arm must have; see `Arm.digest`.
    """

    source: str = "paper"
    tool_frame: str = "tool0"
    package_dirs: tuple[str, ...] = ()
    actuated: tuple[str, ...] | None = None
    home: tuple[float, ...] | None = None
    velocity_limits: tuple[float, ...] | None = None
    digest: str | None = None

    def __post_init__(self) -> None:
        check_fields(self)

    def resolved(self, folder: Path) -> "ArmSpecification":
        """The same arm with absolute paths; relative ones start at a folder."""
        source, path = self.source, folder / self.source
        is_path = Path(source).suffix == ".urdf" or Path(source).parent != Path()
        if source not in arm_names() and (is_path or path.is_file()):
            source = str(path.resolve())
        folders = tuple(str((folder / each).resolve()) for each in self.package_dirs)
        return replace(self, source=source, package_dirs=folders)

    @property
    def name(self) -> str:
        """Name of a shipped arm, or of the file without its ending."""
        return self.source if self.source in arm_names() else Path(self.source).stem
