"""``kinarm-plan``: a motion of an arm that touches nothing, as CSV, JSON or a page."""

from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import ClassVar

from kinarm._command_line import run_request
from kinarm._fields import init_fields
from kinarm._files import check_output
from kinarm.errors import POSITIVE, InvalidInputError
from kinarm.policies.planning.settings import PlanSettings
from kinarm.problem_options import ProblemOptions

SUFFIXES = (".csv", ".json", ".html")

OF_EPISODES = ("task", "plant", "feedback", "shield", "tolerance", "horizon", "start_spread")
"""Options of a problem that a plan does not depend on."""


@dataclass(frozen=True, kw_only=True)
class PlanRequest(PlanSettings, ProblemOptions):
    """Plan a motion from rest to rest that touches nothing at any time.

    Parameters
    ----------
    start, goal : tuple of float
        Where it begins, or ends, as its kind says.
    rate : float
        Rows a second of the outputs [Hz].
    out : tuple of Path
        File to write; .csv, .json (the fields of a ROS JointTrajectory) or
        .html (a replay); repeatable.
    overwrite : bool
        Replace earlier files.
    """

    start: tuple[float, ...] = ()
    goal: tuple[float, ...]
    rate: float = field(default=100.0, metadata=POSITIVE)
    out: tuple[Path, ...] = field(default=(), metadata={"metavar": "FILE", "repeat": True})
    overwrite: bool = False

    MOTION: ClassVar = "start start_kind goal goal_kind margin speed acceleration jerk samples seed"
    GROUPS: ClassVar = {"motion": MOTION, **ProblemOptions.GROUPS}
    DEFAULTS: ClassVar = {
        **ProblemOptions.DEFAULTS,
        "start": "home",
        "acceleration": "full speed in 0.5 s",
        "jerk": "full acceleration in 0.1 s",
    }


def _plan(request: PlanRequest, _: str) -> None:
    for path in request.out:
        if path.suffix not in SUFFIXES:
            raise InvalidInputError(f"--out ends in {', '.join(SUFFIXES)}, got {str(path)!r}")
        check_output(path, overwrite=request.overwrite)
    from kinarm.policies import plan

    settings = {name: getattr(request, name) for name in init_fields(PlanSettings)}
    made = plan(request.resolve("both"), request.start or None, request.goal, **settings)
    print(f"{made.duration:.3f} s; {made.proven}")
    for waypoint in made.waypoints:
        print("  ".join(f"{value:8.4f}" for value in waypoint))
    for path in request.out:
        if path.suffix == ".html":
            from kinarm.viewer import replay_page

            replay_page(made.recording(), path)
        else:
            save = made.save_csv if path.suffix == ".csv" else made.save_json
            save(path, request.rate)
        print(f"written: {path}")


main = partial(run_request, "kinarm-plan", PlanRequest, _plan, skip=OF_EPISODES)
"""Run the command line."""
