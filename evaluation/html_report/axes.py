"""Axes of a chart: from data to places in an SVG, with ticks and their labels."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.html_report.markup import Markup, join, tag

SCALES: dict[str, Callable[[Any], Any]] = {"linear": np.asarray, "log": np.log, "sqrt": np.sqrt}
"""How values are spread along an axis, by name."""


@dataclass(frozen=True)
class Axis:
    """Maps values to places along one direction of an SVG.

    Attributes
    ----------
    low, high : float
        Range of the values.
    start, end : float
        Where that range lies.
    scale : str
        One of `SCALES`.
    """

    low: float
    high: float
    start: float
    end: float
    scale: str = "linear"

    def __call__(self, values: NDArray[np.float64] | float) -> NDArray[np.float64]:
        """Places of values; those beyond the range go to its ends."""
        inside = np.clip(values, self.low, self.high)
        low, high, inside = (SCALES[self.scale](part) for part in (self.low, self.high, inside))
        places: NDArray[np.float64] = self.start + (inside - low) / (high - low) * (
            self.end - self.start
        )
        return places


def log_ticks(low: float, high: float) -> list[float]:
    """1, 2 and 5 times the powers of ten within a range."""
    exponents = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    ticks = [float(f"{digit}e{exponent}") for exponent in exponents for digit in (1, 2, 5)]
    return [tick for tick in ticks if low <= tick <= high]


def bottom_axis(axis: Axis, ticks: list[float], top: float, bottom: float, title: str) -> Markup:
    """Vertical lines at the ticks, their values below, and what they mean."""
    marks = [
        join(
            tag("path", d=f"M{float(axis(tick)):.1f},{top}V{bottom}", class_="grid"),
            tag("text", f"{tick:g}", x=float(axis(tick)), y=bottom + 15, class_="tick middle"),
        )
        for tick in ticks
    ]
    middle = (axis.start + axis.end) / 2
    return join(marks, tag("text", title, x=middle, y=bottom + 34, class_="tick middle"))


def left_axis(axis: Axis, shares: list[float], left: float, right: float) -> Markup:
    """Horizontal lines at some shares, with their per cent to the left."""
    return join(
        [
            tag("path", d=f"M{left},{float(axis(share)):.1f}H{right}", class_="grid"),
            tag(
                "text",
                f"{100 * share:g} %",
                x=left - 6,
                y=float(axis(share)) + 4,
                class_="tick end",
            ),
        ]
        for share in shares
    )


def tolerance_line(axis: Axis, tolerance: float, top: float, bottom: float) -> Markup:
    """A line where goals count as reached."""
    return tag("path", d=f"M{float(axis(tolerance)):.1f},{top}V{bottom}", class_="tolerance")
