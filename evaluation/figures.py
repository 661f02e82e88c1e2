"""Figures of an evaluation."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm._files import write_atomically
from kinarm.evaluation.statistics import squared_reach

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#999999", "#000000")
"""Distinguishable with any colour vision (Okabe and Ito)."""

DASHES = ("solid", "dashed", "dotted", "dashdot")

BIN_WIDTH = 0.05

Points = NDArray[np.float64]


def panels_figure(
    size: tuple[float, float], rows: int, columns: int, **options: Any
) -> "tuple[Figure, NDArray[Any]]":
    """A figure and its panels, shape (rows, columns), with left and bottom spines.

    Parameters
    ----------
    size : tuple of float
        Width and height [inches].
    rows, columns, **options
        As for ``subplots`` of Matplotlib.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False, **options)
    for axes in panels.flat:
        axes.spines[["top", "right"]].set_visible(False)
    return figure, panels


class Band(NamedTuple):
    """Mean of the curves of some seeds, and its 95 % interval; shape (n_points,)."""

    places: Points
    mean: Points
    low: Points
    high: Points

    @classmethod
    def of(cls, curves: Sequence[tuple[Points, Points]]) -> "Band":
        """The mean of shares and Student's interval over the seeds, at each point.

        The points are those of the curve with the fewest, from where all have begun to where the
        first one ends; others are interpolated linearly. A single seed has no interval.
        """
        coarsest = min((x for x, _ in curves), key=len)
        first, last = max(x[0] for x, _ in curves), min(x[-1] for x, _ in curves)
        places = np.unique(coarsest.clip(first, max(first, last)))
        heights = np.array([np.interp(places, x, y) for x, y in curves])
        mean = heights.mean(axis=0)
        reach = np.sqrt(squared_reach(heights)) if len(curves) > 1 else 0.0
        return cls(places, mean, *np.array([mean - reach, mean + reach]).clip(0, 1))

    def draw(self, axes: "Axes", label: str, number: int) -> None:
        """Draw it; its number decides colour and dash."""
        colour, dash = COLOURS[number % len(COLOURS)], DASHES[number // len(COLOURS) % len(DASHES)]
        axes.fill_between(self.places, self.low, self.high, color=colour, alpha=0.15, lw=0)
        axes.plot(self.places, self.mean, color=colour, linestyle=dash, lw=2, label=label)


def save_figure(figure: "Figure", folder: Path, name: str) -> tuple[Path, ...]:
    """Write a figure as PNG and SVG, with the same bytes at any time.

    Parameters
    ----------
    figure, folder : Figure, Path
        What to write, and the folder, which exists.
    name : str
        Name of the files without suffix.
    """
    import matplotlib

    paths = (folder / f"{name}.png", folder / f"{name}.svg")
    metadata = ({"Software": None}, {"Date": None, "Creator": None})
    with matplotlib.rc_context({"svg.hashsalt": "kinarm"}):
        for path, entries in zip(paths, metadata, strict=True):
            write_atomically(
                path,
                partial(figure.savefig, format=path.suffix[1:], dpi=150, metadata=entries),
            )
    return paths
