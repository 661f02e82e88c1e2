"""Which arm: its name or file and its used parts, without loading it."""

from dataclasses import dataclass, field, replace
from pathlib import Path

from kinarm._fields import Checked, from_plain, init_fields, read_toml
from kinarm._files import absolute, is_file, shipped_files
from kinarm.bodies import HeldBody, read_meshes
from kinarm.errors import POSITIVE, ArmError, whole_number

PACKAGE = "example-robot-data:"
"""Prefix of sources in the installed package of that name."""

MOST_PIECES = 32
"""Pieces of a mesh at most."""


def arm_names() -> tuple[str, ...]:
    """Names of shipped arms, and of those whose package is known."""
    return tuple(shipped_files("arms"))


@dataclass(frozen=True, kw_only=True)
class AllowedContact(Checked):
    """Two links or held bodies whose contact counts for nothing.

    Parameters
    ----------
    links : tuple of str
        Their names.
    reason : str
        Why, for people.
    """

    links: tuple[str, str]
    reason: str


@dataclass(frozen=True, kw_only=True)
class ArmSpecification(Checked):
    """Which arm, and what of it the simulator is to use.

    What is left out is what the arm file says, if the source has one; see
    `ArmFile`.

    Parameters
    ----------
    source : str
        Name of an arm, or path of a URDF or of an arm file.
    tool_frame : str
        Link (frame) whose origin is the tool point; by default ``tool0``, or
        the last link of the longest chain of joints.
    tool_offset : tuple of float
        The tool point in the tool frame, instead of its origin [m].
    package_dirs : tuple of str
        Folders that hold the packages which ``package://`` mesh names refer to;
        the folders around the URDF are searched, too.
    actuated : tuple of str
        Names of the joints that actions move, from the base on; empty for all.
        By default all but the trailing ones that cannot move the tool point, or
        all if goals are poses. The others stay at home.
    held : dict
        Positions of joints that are locked, by name [rad or m]; those that do
        not carry the tool are locked anyway, where the URDF has them at zero or
        as close to it as their limits allow.
    limits : dict
        Lower and upper limits to use instead of the URDF's, by joint [rad or
        m].
    home : tuple of float
        Reference configuration; zero, clipped to the limits, by default [rad or
        m].
    velocity_limits : tuple of float
        Limits to use instead of the URDF's [rad/s or m/s].
    pieces : dict
        How many convex pieces meshes are cut into, by link; elsewhere their
        convex hulls count.
    held_bodies : tuple of HeldBody
        What links hold, such as a pen in the gripper.
    allowed_contacts : tuple of AllowedContact
        Links or held bodies that may touch.
    digest : str
        Hash that the arm must have; see `Arm.digest`.
    """

    source: str = "paper"
    tool_frame: str | None = None
    tool_offset: tuple[float, float, float] | None = None
    package_dirs: tuple[str, ...] = ()
    actuated: tuple[str, ...] | None = None
    held: dict[str, float] | None = field(default=None, hash=False)
    limits: dict[str, tuple[float, float]] | None = field(default=None, hash=False)
    home: tuple[float, ...] | None = None
    velocity_limits: tuple[float, ...] | None = field(default=None, metadata=POSITIVE)
    pieces: dict[str, int] | None = field(default=None, hash=False)
    held_bodies: tuple[HeldBody, ...] | None = None
    allowed_contacts: tuple[AllowedContact, ...] | None = None
    digest: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for link, count in (self.pieces or {}).items():
            whole_number(f"pieces.{link}", count, 1, MOST_PIECES)

    def resolved(self, folder: Path) -> "ArmSpecification":
        """The same arm with absolute paths, from a folder."""
        source, path = self.source, folder / self.source
        is_path = Path(source).suffix in (".urdf", ".toml") or Path(source).parent != Path()
        known = source in arm_names() or source.startswith(PACKAGE)
        if not known and (is_path or is_file(path)):
            source = str(absolute(path))
        folders = tuple(str(absolute(folder / each)) for each in self.package_dirs)
        return replace(self, source=source, package_dirs=folders)

    def completed(self) -> "ArmSpecification":
        """The same arm, completed by its files down to a URDF."""
        file = ArmFile.of(self.source)
        if file is None:
            return self
        below = file.arm.completed()
        if self.tool_frame not in (None, below.tool_frame):
            below = replace(below, tool_offset=None)  # which is one in the other frame
        given = {name: getattr(self, name) for name in init_fields(type(self)) if name != "source"}
        given = {name: value for name, value in given.items() if value is not None}
        if not self.package_dirs:
            del given["package_dirs"]
        for name in {"held", "limits", "pieces"} & given.keys():
            given[name] = {**(getattr(below, name) or {}), **given[name]}
        return replace(below, **given)

    @property
    def name(self) -> str:
        """Name of a known arm, or stem of the file."""
        return self.source if self.source in arm_names() else Path(self.source).stem


@dataclass(frozen=True, kw_only=True)
class ArmFile(Checked):
    """An arm file: an arm, and the origin of its data.

    A TOML file whose table ``arm`` has the fields of `ArmSpecification`, with
    notes for people.

    Parameters
    ----------
    title : str
        The arm's full name.
    licence, origin : str
        Licence of URDF and meshes, and where they come from.
    velocities, notes : str
        Where the velocity limits come from, and what else was chosen, and why.
    arm : ArmSpecification
        The arm; its ``source`` is a URDF or a known arm.
    """

    title: str = ""
    licence: str = ""
    origin: str = ""
    velocities: str = ""
    notes: str = ""
    arm: ArmSpecification

    @classmethod
    def of(cls, source: str) -> "ArmFile | None":
        """Arm file of a known arm or of a path; None if the source is a URDF.

        Raises InvalidInputError if it cannot be used, and ArmError if there is none.
        """
        if source in arm_names():
            return cls._read(shipped_files("arms")[source])
        path = Path(source)
        if path.suffix != ".toml":
            return None
        if not is_file(path):
            raise ArmError(f"arm file {source!r} does not exist")
        return cls._read(absolute(path))

    @classmethod
    def _read(cls, path: Path) -> "ArmFile":
        """Read an arm file."""
        entries = read_toml(path, "arm")
        read_meshes(entries.get("arm"), path)
        file = from_plain(cls, entries, str(path))
        if file.arm.source.endswith(".toml"):
            raise ArmError(f"{path}: 'arm.source' must be a URDF or a known arm, no arm file")
        if file.arm.digest is not None:
            raise ArmError(f"{path}: 'arm.digest' is for problem files, which say of which arm")
        return replace(file, arm=file.arm.resolved(path.parent))
