"""``kinarm-problem``: list, show, check and import problems."""

from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import ClassVar

from kinarm._command_line import Commands, run_commands
from kinarm._console import open_console
from kinarm._files import check_output
from kinarm._tables import print_table
from kinarm.arm_specification import ArmSpecification, arm_names
from kinarm.bodies import Point
from kinarm.errors import FROM_ZERO, TRIALS, InvalidInputError
from kinarm.problem import ReachProblem
from kinarm.problem_files import problem_names
from kinarm.problem_options import ProblemOptions, say_choices
from kinarm.scene import Mount

HEADINGS = ("problem", "arm", "obstacles", "goals", "step [s]", "tolerance [m]")
EXPENDABLE = ("obstacles", "step [s]", "tolerance [m]")
"""Columns that narrow terminals leave out, in this order."""


@dataclass(frozen=True, kw_only=True)
class ListRequest:
    """List the problems that ship, with arm, scene and goals."""


@dataclass(frozen=True, kw_only=True)
class ShowRequest(ProblemOptions):
    """Print a problem as a problem file.

    Parameters
    ----------
    problem : str
        A problem by name, or a problem file.
    """

    problem: str | None = field(
        default=None,
        metadata={"flag": "problem", "metavar": "NAME_OR_FILE", "names": problem_names},
    )

    DEFAULTS: ClassVar = {**ProblemOptions.DEFAULTS, "problem": "right"}


@dataclass(frozen=True, kw_only=True)
class CheckRequest(ShowRequest):
    """Check goals in reach, free starts, contact, and symmetry.

    Parameters
    ----------
    trials : int
        Trials that the oracle faces.
    seed : int
        Seed of the trials.
    """

    trials: int = field(default=200, metadata=TRIALS)
    seed: int = field(default=0, metadata=FROM_ZERO)

    GROUPS: ClassVar = {"what is checked": "trials seed", **ProblemOptions.GROUPS}


@dataclass(frozen=True, kw_only=True)
class ImportRequest:
    """Turn planning scenes and requests of MoveIt into problem files.

    Parameters
    ----------
    scene : Path
        A planning scene (.yaml), or a folder of scene*.yaml and request*.yaml.
    request : Path
        The motion plan request (.yaml).
    arm : str
        The arm: its name, a URDF, or an arm file.
    position : tuple of float
        Origin of its base in the fixed frame of the scene [m].
    rpy : tuple of float
        Roll, pitch and yaw of the base there [rad].
    out : Path
        Folder of the problem files, which are called as the scenes.
    overwrite : bool
        Replace earlier files.
    """

    scene: Path = field(metadata={"flag": "scene", "metavar": "SCENE"})
    request: Path | None = field(default=None, metadata={"flag": "request", "metavar": "REQUEST"})
    arm: str = field(metadata={"metavar": "ARM", "names": arm_names})
    position: Point = (0.0, 0.0, 0.0)
    rpy: Point = (0.0, 0.0, 0.0)
    out: Path = field(metadata={"metavar": "FOLDER"})
    overwrite: bool = False


def rows() -> list[tuple[str, ...]]:
    """A row for each shipped problem, under `HEADINGS`."""
    return [
        (
            problem.name,
            problem.arm.name,
            ", ".join(each.name for each in problem.scene.obstacles) or "none",
            ", ".join(problem.task.goal_regions),
            f"{problem.stepping.time_step:g}",
            f"{problem.task.tolerance:g}",
        )
        for problem in map(ReachProblem.load, problem_names())
    ]


def _check(request: CheckRequest) -> None:
    from kinarm.evaluation.problem_check import check_problem
    from kinarm.world import World

    problem = request.resolve()
    say_choices([problem])
    with open_console(stderr=True).status("checking") as status:
        check = check_problem(
            World(problem),
            request.trials,
            request.seed,
            lambda done, total: status.update(f"{done} of {total} trials solved"),
        )
    goals = " and ".join(problem.task.goal_regions)
    print(f"{problem.name}: arm {problem.arm.name}, goals {goals}")
    print(check)


def _import(request: ImportRequest) -> None:
    from kinarm.collision import ContactModel
    from kinarm.moveit import import_problem

    arm = ArmSpecification(source=request.arm).resolved(Path())
    mount = Mount(position=request.position, rpy=request.rpy)
    scenes = [request.scene] if request.request else sorted(request.scene.glob("scene*.yaml"))
    if not scenes:
        raise InvalidInputError(f"{request.scene} is no folder with files such as scene1.yaml")
    made = {}
    for scene in scenes:
        out = request.out / f"{scene.stem}.toml"
        check_output(out, overwrite=request.overwrite)
        beside = scene.with_name(scene.name.replace("scene", "request", 1))
        made[out] = import_problem(scene, request.request or beside, arm, mount)
    both = 0
    for out, (problem, start_and_goal) in made.items():
        problem.save(out)
        contact = ContactModel.build(problem.load_arm(), problem.scene)
        pairs = list(map(contact.contact_pair, start_and_goal))
        start, goal = ("free" if pair is None else " touches ".join(pair) for pair in pairs)
        print(f"{out}: start {start}, goal {goal}")
        both += pairs == [None, None]
    print(f"start and goal are free in {both} of {len(made)} problems")


COMMANDS: Commands = {
    "list": (ListRequest, lambda _: print_table(HEADINGS, rows(), EXPENDABLE)),
    "show": (ShowRequest, lambda request: print(request.resolve().to_toml(), end="")),
    "check": (CheckRequest, _check),
    "import": (ImportRequest, _import),
}


main = partial(run_commands, "kinarm-problem", "List, show, check and import problems.", COMMANDS)
"""Run the command line."""
