"""Replay pages: recordings as one HTML file that plays offline, in any browser with WebGL."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kinarm.errors import InvalidInputError
from kinarm.problem import ProblemLike
from kinarm.recording import Recording, record_path
from kinarm.viewer.camera import stage_scale
from kinarm.viewer.drawing import CapturingWindow, draw_goal, draw_stage, draw_trace
from kinarm.viewer.html_page import HtmlPage, arm_data, page_html
from kinarm.viewer.parts import OUTCOME_COLOURS, TRACE_SIDES
from kinarm.world import World


class ReplayPage(HtmlPage):
    """A page that plays recordings. In a notebook it shows itself."""


def replay_page(
    recordings: Recording | Sequence[Recording],
    path: str | Path | None = None,
    *,
    ghosts: Sequence[Recording] = (),
    groups: Sequence[str] = (),
    heading: str = "",
) -> ReplayPage:
    """Make a page that plays recordings; the same recordings make the same page.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        The recordings to play, one trial after the other.
    path : str or Path, optional
        File of the page; without it, no file is written.
    ghosts : sequence of Recording
        Recordings of another policy in the same trials, shown in the same scene.
    groups : sequence of str
        Group of each recording, for a list of the trials; recordings of a group follow each other.
        Without groups there is no list.
    heading : str
        Heading of the list.

    Raises
    ------
    InvalidInputError
        If there is no recording, or they cannot share a page.
    ArmError
        If the recorded arm is missing, or has changed.
    """
    chosen = [recordings] if isinstance(recordings, Recording) else list(recordings)
    _check_recordings(chosen, ghosts)
    if groups and len(groups) != len(chosen):
        raise InvalidInputError(
            f"there must be a group for each recording: {len(groups)} for {len(chosen)}"
        )
    page = ReplayPage(_replay_html(chosen, ghosts, groups, heading))
    if path is not None:
        page.save(path)
    return page


def replay_path(
    problem: ProblemLike | World,
    path: ArrayLike,
    file: str | Path | None = None,
    *,
    goal: ArrayLike | None = None,
    name: str = "path",
) -> ReplayPage:
    """Make a page that plays your own path; it ends at contact, and shows it.

    Parameters
    ----------
    problem, path, goal, name
        As for `kinarm.record_path`.
    file : str or Path, optional
        Where to write the page, if at all.
    """
    return replay_page(record_path(problem, path, goal=goal, name=name), file)


def _check_recordings(recordings: Sequence[Recording], ghosts: Sequence[Recording]) -> None:
    """See that recordings can share a page."""
    if not recordings:
        raise InvalidInputError("there is no recording to replay")
    first = recordings[0].problem
    for problem in dict.fromkeys(each.problem for each in (*recordings, *ghosts)):
        if problem.arm_digest != first.arm_digest:
            raise InvalidInputError(
                f"the recordings are of different arms: {first.arm.name!r} ({first.arm_digest}) "
                f"and {problem.arm.name!r} ({problem.arm_digest})"
            )
        if problem.scene != first.scene:
            raise InvalidInputError("the recordings were made in different scenes")
    if ghosts and len(ghosts) != len(recordings):
        raise InvalidInputError(
            f"there must be a ghost for each recording: {len(ghosts)} for {len(recordings)}"
        )
    for recording, ghost in zip(recordings, ghosts, strict=False):
        if not recording.same_trial(ghost):
            raise InvalidInputError(
                f"trial {recording.trial} of {recording.policy!r} and trial {ghost.trial} of "
                f"{ghost.policy!r} differ in start or goal: they cannot be compared"
            )


def _replay_html(
    recordings: Sequence[Recording],
    ghosts: Sequence[Recording],
    groups: Sequence[str],
    heading: str,
) -> str:
    """Page of recordings that can share one."""
    arm, scene = recordings[0].problem.load_arm(), recordings[0].problem.scene
    trials = list(zip(recordings, ghosts, strict=True)) if ghosts else [(r,) for r in recordings]
    policies = dict.fromkeys(run.policy for runs in trials for run in runs)
    window, problem = CapturingWindow(), recordings[0].problem
    draw_stage(window.top, arm, scene)
    draw_goal(window.top["goal"], problem)
    for number, runs in enumerate(trials):
        for name, run in zip(("run", "ghost"), runs, strict=False):
            points = np.array([arm.tool_position(state) for state in run.states])
            way = window.top[f"trials/{number}/{name}"]
            draw_trace(way, points, run.outcome, stage_scale(arm, scene))
    data = {
        **arm_data(arm, scene),
        "traceIndices": 6 * TRACE_SIDES,
        "colours": {name: f"#{colour:06x}" for name, colour in OUTCOME_COLOURS.items()},
        "trials": [_trial_data(runs) for runs in trials],
        "groups": list(groups),
        "heading": heading,
    }
    title = f"{' and '.join(policies)} · kinarm replay"
    scripts = ("replay_stage", "trial_list", "player")
    return page_html("player", title, window.content, data, scripts)


def _trial_data(runs: Sequence[Recording]) -> dict[str, Any]:
    """The trial that recordings are of, and what happened in it, as JSON."""
    first, problem = runs[0], runs[0].problem
    return {
        "problem": problem.name,
        "trial": first.trial,
        "goal": first.goal.tolist(),
        "tolerance": problem.task.tolerance,
        "horizon": problem.task.horizon,
        "timeStep": problem.stepping.time_step,
        "floor": first.steps_lower_bound,
        "runs": [_run_data(run) for run in runs],
    }


def _run_data(run: Recording) -> dict[str, Any]:
    """A recording, as JSON."""
    data = {name: getattr(run, name) for name in ("policy", "outcome", "contact")}
    arrays = {"contactPoint": run.contact_point, "refused": run.refused}
    arrays |= {"states": run.states, "distances": run.distances}
    return data | {name: None if a is None else a.tolist() for name, a in arrays.items()}
