"""Which problem: the options that all commands and their requests share."""

import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from kinarm._fields import Checked, init_fields
from kinarm.arm_specification import arm_names
from kinarm.plant import plant_names
from kinarm.problem import ProblemLike, ReachProblem
from kinarm.problem_files import problem_names, scene_names

if TYPE_CHECKING:
    from kinarm.arm import Arm


@dataclass(frozen=True, kw_only=True)
class ProblemOptions(Checked):
    """Which problem: the options that all commands share.

    Parameters
    ----------
    problem : str
        A problem by name, or a problem file.
    arm : str
        Another arm: its name, a URDF, or an arm file.
    tool_frame : str
        Link of the arm whose origin is the tool point.
    package_dirs : tuple of str
        Folder of packages that package:// meshes of a URDF are in; repeatable.
    task : str
        The task of another problem, by its name or file.
    scene : str
        Another scene, by its name or that of a problem, or a file.
    plant : str
        What lies between commands and joints, by name or file.
    feedback : {"measured", "commanded"}
        Which joint positions are seen.
    shield : bool
        Replace steps that would touch something.
    tolerance : float
        Distance at which a goal counts as reached [m].
    horizon : int
        Steps after which an episode is truncated.
    start_spread : float
        Scales the range of the start configurations, from 0 (home) to 1 (all).
    """

    problem: str | None = field(default=None, metadata={"names": problem_names})
    arm: str | None = field(default=None, metadata={"names": arm_names})
    tool_frame: str | None = None
    package_dirs: tuple[str, ...] = field(
        default=(), metadata={"flag": "--package-dir", "metavar": "FOLDER", "repeat": True}
    )
    task: str | None = None
    scene: str | None = field(default=None, metadata={"names": scene_names})
    plant: str | None = field(default=None, metadata={"names": plant_names})
    feedback: Literal["measured", "commanded"] | None = None
    shield: bool = False
    tolerance: float | None = None
    horizon: int | None = None
    start_spread: float | None = None

    CHANGES: ClassVar = (
        "arm tool_frame package_dirs task scene plant feedback shield tolerance horizon "
        "start_spread"
    )
    """Fields that change a problem."""

    GROUPS: ClassVar[Mapping[str, str]] = {"problem": f"problem {CHANGES}"}
    """Fields by the titles of groups."""

    DEFAULTS: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(
            ("arm", "task", "scene", "plant", "feedback", "tolerance", "horizon", "start_spread"),
            "the problem's",
        ),
        "tool_frame": "the arm's",
    }
    """Values without an option, in words."""

    SHIELDS_POLICIES: ClassVar = False
    """Whether a shield is that of policies, and the problem stays as it is."""

    def resolve(self, default: ProblemLike = "right") -> ReachProblem:
        """The problem that the options make of a default."""
        changed = {name: getattr(self, name) for name in init_fields(ProblemOptions)}
        named = changed.pop("problem")
        if named is None and self.task is not None:
            named = changed.pop("task")
        problem = ReachProblem.load(default if named is None else named)
        for name in ("arm", "tool_frame", "package_dirs"):
            del changed[name]
        changed["shield"] = (self.shield and not self.SHIELDS_POLICIES) or None
        return problem.replace(arm=self._arm(problem), **changed)

    def _arm(self, problem: ReachProblem) -> "Arm | None":
        """The arm that the options name or change, or None."""
        from kinarm.arm import Arm  # loads Pinocchio, unlike --help

        given: dict[str, Any] = {"package_dirs": self.package_dirs} if self.package_dirs else {}
        if self.tool_frame is not None:
            given |= {"tool_frame": self.tool_frame, "tool_offset": None}
        if self.arm is not None:
            return Arm.load(self.arm, **given)
        return Arm.load(replace(problem.arm, digest=None), **given) if given else None


def say_choices(problems: Iterable[ReachProblem]) -> None:
    """Say on standard error what was chosen for problems' URDFs, and what is doubtful in them."""
    for specification in dict.fromkeys(problem.arm for problem in problems):
        if specification.source not in arm_names() or specification.held_bodies:
            from kinarm.arm import Arm
            from kinarm.contact_statistics import arm_warnings, contact_on_bare_ground

            arm = Arm.load(specification)
            chosen = filter(None, ["; ".join(arm.description.notes)])
            for line in (*chosen, *arm_warnings(contact_on_bare_ground(arm))):
                sys.stderr.write(f"arm {specification.name}: {line}\n")
