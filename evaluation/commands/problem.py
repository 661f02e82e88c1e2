"""``kinarm-problem``: list, show and check problems."""

import json
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, ClassVar, cast

from kinarm._command_line import Commands, run_commands
from kinarm._console import working
from kinarm._files import check_output, write_atomically, write_text
from kinarm._tables import print_table
from kinarm.errors import FROM_ZERO, TRIALS
from kinarm.problem import ReachProblem, problem_names
from kinarm.problem_options import ProblemOptions, say_choices

if TYPE_CHECKING:
    from kinarm.evaluation.problem_check import ProblemCheck

HEADINGS = ("problem", "arm", "obstacles", "goals", "step [s]", "tolerance [m]")
EXPENDABLE = ("obstacles", "step [s]", "tolerance [m]")
"""Columns that narrow terminals leave out, in this order."""

PICTURE_SIZE = 960, 640


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
    """Check which goals can be reached, how many starts are free, what touches, and the symmetry.

    Parameters
    ----------
    trials : int
        Trials that the oracle faces.
    seed : int
        Seed of the trials.
    picture : Path
        Picture of arm and scene (.png).
    json : Path
        All findings, as JSON.
    overwrite : bool
        Replace earlier files.
    """

    trials: int = field(default=200, metadata=TRIALS)
    seed: int = field(default=0, metadata=FROM_ZERO)
    picture: Path | None = field(default=None, metadata={"metavar": "FILE.png"})
    json: Path | None = field(default=None, metadata={"metavar": "FILE.json"})
    overwrite: bool = False

    GROUPS: ClassVar = {
        "what is checked": ("trials", "seed"),
        "output": ("picture", "json", "overwrite"),
        **ProblemOptions.GROUPS,
    }

    def run(self) -> "ProblemCheck":
        """Check the problem, and write the outputs."""
        from kinarm.evaluation.problem_check import check_problem
        from kinarm.world import World

        problem = self.resolve()
        for path, suffix in ((self.picture, ".png"), (self.json, ".json")):
            if path is not None:
                check_output(path, overwrite=self.overwrite, suffix=suffix)
        say_choices([problem])
        with working("checking") as say:
            check = check_problem(
                World(problem),
                self.trials,
                self.seed,
                lambda done, total: say(f"{done} of {total} trials solved"),
            )
        if self.json is not None:
            write_text(self.json, json.dumps(check.to_json(), indent=1))
        if self.picture is not None:
            write_picture(self.picture, problem)
        return check


def write_picture(path: Path, problem: ReachProblem) -> None:
    """Write a picture of the arm at home, with a goal in mid-region."""
    from matplotlib.image import imsave

    from kinarm.viewer import Renderer

    region = problem.scene.goal_region(problem.task.goal_regions[0])
    goal = [(low + high) / 2 for low, high in zip(region.lower, region.upper, strict=True)]
    width, height = PICTURE_SIZE
    taken = Renderer(problem, width=width, height=height).render(problem.load_arm().home, goal)
    write_atomically(path, lambda file: imsave(cast("BinaryIO", file), taken, format="png"))


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
    check, problem = request.run(), request.resolve()
    goals = " and ".join(problem.task.goal_regions)
    print(f"{problem.name}: arm {problem.arm.name}, goals {goals}")
    print(check)
    for path in (request.json, request.picture):
        if path is not None:
            print(f"  written  {path}")


COMMANDS: Commands = {
    "list": (ListRequest, lambda _: print_table(HEADINGS, rows(), EXPENDABLE)),
    "show": (ShowRequest, lambda request: print(request.resolve().to_toml(), end="")),
    "check": (CheckRequest, _check),
}


main = partial(run_commands, "kinarm-problem", "List, show and check problems.", COMMANDS)
"""Run the command line."""
