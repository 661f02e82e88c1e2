"""A board on which trainings in several processes write progress, and find the request to stop."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from kinarm.policies.learners import TrainingState
from kinarm.policies.training import STARTING

WAITING, PREPARING, TRAINING = range(3)
"""Phases of a training."""

ROW = np.dtype(
    [
        *(("phase", "i8"), ("iteration", "i8"), ("mean_return", "f8"), ("success", "f8")),
        ("activity", "U48"),
    ]
)
"""What is known of a training; while it is prepared, what takes long, in words."""


@dataclass(frozen=True)
class ProgressBoard:
    """A folder that the processes share.

    Parameters
    ----------
    folder : Path
        The folder, of this machine.
    trainings : int
        How many there are.
    """

    folder: Path
    trainings: int

    @property
    def _stop(self) -> Path:
        return self.folder / "stop"

    def asked_to_stop(self) -> bool:
        """Whether the trainings are to stop after their iteration."""
        return self._stop.exists()

    def ask_to_stop(self) -> None:
        """Let the trainings stop after their iteration."""
        self._stop.touch()

    def clear(self) -> None:
        """Let all trainings wait; called once, before there are others that see the board."""
        np.zeros(self.trainings, ROW).tofile(self._rows)

    @property
    def _rows(self) -> Path:
        return self.folder / "rows"

    @cached_property
    def rows(self) -> "np.memmap[Any, np.dtype[Any]]":
        """What is known of each training, as all processes see it, shape (trainings,)."""
        return np.memmap(self._rows, ROW, "r+", shape=(self.trainings,))

    @property
    def iterations(self) -> int:
        """Finished iterations of all trainings."""
        return int(self.rows["iteration"].sum())

    def words(self) -> list[str]:
        """What the trainings are doing, and the range of their success."""
        rows = self.rows[self.rows["phase"] != WAITING]
        known = rows["success"][(rows["phase"] == TRAINING) & np.isfinite(rows["success"])]
        if len(known):
            extremes = dict.fromkeys((f"{100 * known.min():.0f}", f"{100 * known.max():.0f}"))
            return [f"success {'-'.join(extremes)} %"]
        activities = filter(None, rows["activity"][rows["phase"] == PREPARING])
        return [str(next(activities, STARTING))]


class BoardWatcher:
    """Writes how far a training is on a board.

    Parameters
    ----------
    board : ProgressBoard
        The board.
    number : int
        Which training it is.
    """

    def __init__(self, board: ProgressBoard, number: int) -> None:
        self._row = board.rows[number : number + 1]

    def prepare(self, activity: str) -> None:
        """Note what the training does before it goes on."""
        self._row["activity"] = activity
        self._row["phase"] = PREPARING

    def update(self, state: TrainingState) -> None:
        """Note the latest iteration."""
        point = state.curve[-1]
        self._row[0] = (TRAINING, state.iteration, point.mean_return, point.success, "")
