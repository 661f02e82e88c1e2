"""Replay pages: recordings as one HTML file that plays offline, in any browser with WebGL."""

import base64
import gzip
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from itertools import zip_longest
from pathlib import Path

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from kinarm._files import write_text
from kinarm.errors import InvalidInputError
from kinarm.recording import Recording
from kinarm.viewer.player_data import player_data
from kinarm.viewer.scene_commands import scene_commands

NOTEBOOK_HEIGHT = 560
"""Height of a page in a notebook [pixels]."""

NOTEBOOK_FRAME = Markup(
    '<iframe srcdoc="{}" title="Replay of recorded trials" '
    'style="width: 100%; height: {}px; border: 0; border-radius: 8px" '
    'loading="lazy" allowfullscreen></iframe>'
)


@dataclass(frozen=True)
class ReplayPage:
    """A page that plays recordings. In a notebook it shows itself.

    Attributes
    ----------
    html : str
        The whole page; it refers to nothing outside of itself.
    """

    html: str

    def save(self, path: str | Path) -> None:
        """Write the page to a file.

        Raises
        ------
        OutputError
            If the file cannot be written; an existing file is then left as it was.
        """
        write_text(path, self.html)

    def __repr__(self) -> str:
        return f"ReplayPage({len(self.html) / 1e6:.1f} MB of HTML)"

    def _repr_html_(self) -> str:
        return NOTEBOOK_FRAME.format(self.html, NOTEBOOK_HEIGHT)


def replay_page(
    recordings: Recording | Sequence[Recording],
    path: str | Path | None = None,
    *,
    ghosts: Sequence[Recording] = (),
) -> ReplayPage:
    """Make a page that plays recordings; the same recordings make the same page.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        What to play, one trial after the other.
    path : str or Path, optional
        Where to write the page, if at all.
    ghosts : sequence of Recording
        What another policy did in the same trials, to be shown in the same scene.

    Raises
    ------
    InvalidInputError
        If there is no recording, or they cannot share a page.
    ArmError
        If the arm that was recorded is not there any more, or has changed.
    OutputError
        If the file cannot be written.
    """
    chosen = [recordings] if isinstance(recordings, Recording) else list(recordings)
    _check_recordings(chosen, ghosts)
    page = ReplayPage(_page_html(chosen, ghosts))
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


def _page_html(recordings: Sequence[Recording], ghosts: Sequence[Recording]) -> str:
    """Fill the template with Meshcat's viewer, the scene, the trials and the player."""
    arm = recordings[0].problem.load_arm()
    trials = [[run for run in runs if run is not None] for runs in zip_longest(recordings, ghosts)]
    data = json.dumps(player_data(trials, arm), separators=(",", ":"), sort_keys=True)
    template = Environment(autoescape=True, undefined=StrictUndefined, keep_trailing_newline=True)
    return template.from_string(_file_text("kinarm.viewer", "player.html")).render(
        policies=list(dict.fromkeys(run.policy for runs in trials for run in runs)),
        style=_file_text("kinarm.viewer", "player.css"),
        licence=_file_text("meshcat", "viewer/dist/main.min.js.LICENSE.txt").replace("--", "- -"),
        meshcat=_meshcat_base64(),
        scene=_gzip_base64(scene_commands(trials, arm)),
        trials=_gzip_base64(data.encode()),
        stage=_file_text("kinarm.viewer", "stage.js"),
        player=_file_text("kinarm.viewer", "player.js"),
    )


def _file_text(package: str, name: str) -> Markup:
    """Text of a file that came with a package, to be put into the page as it is."""
    return Markup((resources.files(package) / name).read_text(encoding="utf-8"))


@cache
def _meshcat_base64() -> str:
    return _gzip_base64(_file_text("meshcat", "viewer/dist/main.min.js").encode())


def _gzip_base64(content: bytes) -> str:
    return base64.b64encode(gzip.compress(content, 9, mtime=0)).decode()
