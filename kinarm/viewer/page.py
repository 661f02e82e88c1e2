"""Replay pages: recordings as one HTML file that plays offline, in any browser with WebGL."""

from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path

from kinarm.errors import InvalidInputError
from kinarm.recording import Recording
from kinarm.viewer.html_page import HtmlPage, page_html
from kinarm.viewer.player_data import player_data
from kinarm.viewer.scene_commands import replay_commands


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
    OutputError
        If the file cannot be written.
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
    arm = recordings[0].problem.load_arm()
    trials = [[run for run in runs if run is not None] for runs in zip_longest(recordings, ghosts)]
    policies = dict.fromkeys(run.policy for runs in trials for run in runs)
    return page_html(
        "player",
        f"{' and '.join(policies)} · kinarm replay",
        replay_commands(trials, arm),
        player_data(trials, arm, groups, heading),
        ("replay_stage", "trial_list", "player"),
    )
