"""``kinarm-problem``: list, show and check problems."""

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from kinarm._command_line import Command, run_commands
from kinarm._console import print_table
from kinarm._files import check_output, write_atomically, write_text
from kinarm._validation import MOST_TRIALS, whole_number
from kinarm.problem_files import problem_names
from kinarm.problem_options import ProblemOptions, say_choices

if TYPE_CHECKING:
    from kinarm.evaluation.problem_check import ProblemCheck
    from kinarm.problem import ReachProblem

EPILOG = """
examples:
  kinarm-problem                                          the problems that ship
  kinarm-problem show shelf-panda > mine.toml             a file to start from
  kinarm-problem show --arm ur5 --scene ring > mine.toml  parts put together
  kinarm-problem check mine.toml --picture mine.png       what can be reached, and what touches
"""

HEADINGS = ("problem", "arm", "obstacles", "goals", "step [s]", "tolerance [m]")
EXPENDABLE = ("obstacles", "step [s]", "tolerance [m]")
"""Columns that a narrow terminal does without, the first ones first."""

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

    Raises
    ------
    InvalidInputError
        If there is no trial or the seed is negative.
    """

    trials: int = 200
    seed: int = 0
    picture: Path | None = field(default=None, metadata={"metavar": "FILE.png"})
    json: Path | None = field(default=None, metadata={"metavar": "FILE.json"})
    overwrite: bool = False

    GROUPS: ClassVar = {
        "what is checked": ("trials", "seed"),
        "output": ("picture", "json", "overwrite"),
        **ProblemOptions.GROUPS,
    }

    def __post_init__(self) -> None:
        whole_number("trials", self.trials, 1, MOST_TRIALS)
        whole_number("seed", self.seed, 0)

    def run(self) -> "ProblemCheck":
        """Check the problem, and write the outputs.

        Raises
        ------
        KinarmError
            If a name, file or number cannot be used, the arm cannot move, or a file cannot be
            written.
        """
        from kinarm._console import working
        from kinarm.evaluation.problem_check import check_problem
        from kinarm.world import World

        problem = self.resolve()
        for path, suffix in ((self.picture, ".png"), (self.json, ".json")):
            if path is not None:
                check_output(path, overwrite=self.overwrite, suffix=suffix)
        say_choices([problem])
        world = World(problem)
        with working("checking") as say:
            check = check_problem(
                world,
                self.trials,
                self.seed,
                lambda done, total: say(f"{done} of {total} trials solved"),
            )
        if self.json is not None:
            write_text(self.json, json.dumps(check.to_json(), indent=1))
        if self.picture is not None:
            write_picture(self.picture, world.problem)
        return check


def write_picture(path: Path, problem: "ReachProblem") -> None:
    """Write a picture of the arm at home, and a goal in the middle of a region."""
    import numpy as np
    from matplotlib.image import imsave

    from kinarm.viewer import Renderer

    region = problem.scene.goal_region(problem.task.goal_regions[0])
    goal = (np.array(region.lower) + np.array(region.upper)) / 2
    width, height = PICTURE_SIZE
    taken = Renderer(problem, width=width, height=height).render(problem.load_arm().home, goal)
    png = BytesIO()
    imsave(png, taken, format="png")
    write_atomically(path, lambda file: file.write(png.getvalue()))


def rows() -> list[tuple[str, ...]]:
    """A row for each problem that ships, under `HEADINGS`."""
    from kinarm.problem import ReachProblem

    return [
        (
            *(problem.name, problem.arm.name),
            ", ".join(each.name for each in problem.scene.obstacles) or "none",
            ", ".join(problem.task.goal_regions),
            f"{problem.stepping.time_step:g}",
            f"{problem.task.tolerance:g}",
        )
        for problem in map(ReachProblem.load, problem_names())
    ]


def _list(_: ListRequest) -> None:
    print_table(HEADINGS, rows(), EXPENDABLE)


def _show(request: ShowRequest) -> None:
    print(request.resolve().to_toml(), end="")


def _check(request: CheckRequest) -> None:
    check = request.run()
    problem = request.resolve()
    print(
        f"{problem.name}: arm {problem.arm.name}, goals {' and '.join(problem.task.goal_regions)}"
    )
    for about, line in check.lines().items():
        print(f"  {about:8} {line}")
    for path in (request.json, request.picture):
        if path is not None:
            print(f"  written  {path}")


COMMANDS = {
    "list": Command(ListRequest, _list),
    "show": Command(ShowRequest, _show),
    "check": Command(CheckRequest, _check),
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    typed = sys.argv[1:] if arguments is None else arguments
    run_commands(
        "kinarm-problem",
        "List, show and check problems.",
        COMMANDS,
        typed or ["list"],
        epilog=EPILOG,
    )


if __name__ == "__main__":
    main()
