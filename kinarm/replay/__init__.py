"""Replays: recordings as one HTML file that plays offline, in any browser with WebGL."""

import html
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from kinarm._files import write_text
from kinarm.arm import Arm
from kinarm.replay.page import build_page, check_recordings
from kinarm.trajectory import Recording

__all__ = ["Replay", "replay"]

HEIGHT = 560
"""Height of a replay in a notebook [pixels]."""


@dataclass(frozen=True)
class Replay:
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
        return f"Replay({len(self.html) / 1e6:.1f} MB of HTML)"

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{html.escape(self.html)}" title="Replay of recorded trials" '
            f'style="width: 100%; height: {HEIGHT}px; border: 0; border-radius: 8px" '
            'loading="lazy" allowfullscreen></iframe>'
        )


def replay(
    recordings: Recording | Sequence[Recording],
    path: str | Path | None = None,
    *,
    ghosts: Sequence[Recording] = (),
    arm: Arm | str | None = None,
) -> Replay:
    """Make a page that plays recordings; the same recordings make the same page.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        What to play, one trial after the other.
    path : str or Path, optional
        Where to write the page, if at all.
    ghosts : sequence of Recording
        What another policy did in the same trials, to be shown in the same scene.
    arm : Arm or str, optional
        The arm that was recorded, where it is not one that ships with kinarm.

    Raises
    ------
    InvalidInputError
        If there is no recording, they cannot share a page, or they are of another arm.
    OutputError
        If the file cannot be written.
    """
    chosen = [recordings] if isinstance(recordings, Recording) else list(recordings)
    if not isinstance(arm, Arm):
        arm = Arm.load(arm or (chosen[0].arm if chosen else "paper"))
    check_recordings(chosen, ghosts, arm)
    page = Replay(build_page(chosen, ghosts, arm))
    if path is not None:
        page.save(path)
    return page
