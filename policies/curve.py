"""Learning curves."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from kinarm._files import write_text


class CurvePoint(NamedTuple):
    """What one iteration of the training looked like.

    Attributes
    ----------
    mean_return, std_return : float
        Mean and standard deviation of the returns of the iteration's episodes; for PPO, of those
        that ended in it. Episodes that replayed a failed scenario do not count; NaN if none does.
    success : float
        Share of these episodes that reached the goal.
    environment_steps : int
        Steps taken since the training began.
    wall_time : float
        Time that iterations took since the training began [s].
    """

    mean_return: float
    std_return: float
    success: float
    environment_steps: int
    wall_time: float


def write_curve(path: Path, curve: Sequence[CurvePoint]) -> None:
    """Write a learning curve as CSV, one line per iteration.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("iteration", *CurvePoint._fields))
    writer.writerows((number, *point) for number, point in enumerate(curve, start=1))
    write_text(path, text.getvalue())
