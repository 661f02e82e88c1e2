"""Replay pages of own paths."""

from __future__ import annotations

from pathlib import Path

from numpy.typing import ArrayLike

from kinarm.paths import record_path
from kinarm.problem import ProblemLike
from kinarm.viewer.page import ReplayPage, replay_page
from kinarm.world import World


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

    Raises
    ------
    KinarmError
        As `kinarm.record_path` and `kinarm.viewer.replay_page` do.
    """
    return replay_page(record_path(problem, path, goal=goal, name=name), file)
