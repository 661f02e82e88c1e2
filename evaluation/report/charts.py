"""Charts of a problem: performance profiles, and histograms of the final distance."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.figures import BIN_WIDTH
from kinarm.evaluation.metrics import LIMITS
from kinarm.evaluation.report.groups import Group, ProblemResults
from kinarm.evaluation.report.svg import Drawing, draw, style
from kinarm.evaluation.statistics import share_over_seeds

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH, LEFT, RIGHT, BELOW = 460, 46, 12, 44
"""Size of a chart and of its margins [points]."""

PROFILE_HEIGHT = 330

POINTS = 121
"""Distances at which a profile is drawn, beside the tolerance and those of the table."""

ROW_HEIGHT = 0.76
"""Of the tallest bar of a histogram, of the height of its row."""


def _chart(height: float, above: float) -> "tuple[Figure, Axes]":
    """An empty chart with these height and margin above its axes [points]."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH / 72, height / 72))
    inside = (WIDTH - LEFT - RIGHT) / WIDTH, (height - above - BELOW) / height
    axes = figure.add_axes((LEFT / WIDTH, BELOW / height, *inside))
    axes.spines[:].set_visible(False)
    axes.tick_params(bottom=False, left=False, labelsize=12, pad=6)
    axes.grid(visible=True)
    return figure, axes


def _finish(axes: "Axes", tolerance: float, title: str) -> None:
    """Add what both charts have, and leave it to the style sheet."""
    style(axes.axvline(tolerance, clip_on=False), "tolerance")
    style(axes.set_xlabel(title, fontsize=12, labelpad=4), "tick middle")
    for line in (*axes.get_xgridlines(), *axes.get_ygridlines()):
        style(line, "grid")
    for label in axes.get_xticklabels():
        style(label, "tick middle")
    for label in axes.get_yticklabels():
        style(label, "tick end")


def profile_chart(results: ProblemResults) -> Drawing:
    """Draw the profiles of a problem with their 95 % bands, the oracle's as well."""
    limits = profile_limits(results)
    figure, axes = _chart(PROFILE_HEIGHT, above=14)
    axes.set(xscale="log", xlim=limits[[0, -1]], ylim=(0, 1))
    axes.set_xticks(log_ticks(limits[0], limits[-1]), minor=False)
    axes.set_xticks([], minor=True)
    axes.set_yticks([0, 0.25, 0.5, 0.75, 1])
    axes.yaxis.set_major_formatter(lambda share, _: f"{100 * share:g} %")
    axes.xaxis.set_major_formatter("{x:g}")
    _finish(axes, results.tolerance, "distance d to the goal [m], logarithmic")
    for place, group in enumerate(reversed(results.groups)):  # the best comes last, on top
        rates, low, high = profile_with_band(group, limits)
        (band,) = axes.fill([*limits, *limits[::-1]], [*high, *low[::-1]], clip_on=False)
        (line,) = axes.plot(limits, rates, clip_on=False)
        for artist, part in ((band, "band"), (line, "line")):
            artist.set_zorder(3 + place)
            style(artist, part, group, title=group.name)
    shares = (
        f"{group.name}: {100 * float((group.distances <= results.tolerance).mean()):.1f} %"
        for group in results.groups
    )
    return draw(
        figure,
        f"Performance profiles on {results.name}. Share of trials within {results.tolerance:g} m: "
        + "; ".join(shares),
    )


def profile_limits(results: ProblemResults) -> NDArray[np.float64]:
    """Distances at which the profiles of a problem are drawn [m], ascending."""
    furthest = max(float(group.distances.max()) for group in results.groups)
    low, high = results.tolerance / 5, max(furthest, 2 * results.tolerance)
    named = [limit for limit in (results.tolerance, *LIMITS) if low <= limit <= high]
    return np.unique(np.concatenate([np.geomspace(low, high, POINTS), named]))


def log_ticks(low: float, high: float) -> list[float]:
    """1, 2 and 5 times the powers of ten within a range."""
    exponents = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    ticks = [float(f"{digit}e{exponent}") for exponent in exponents for digit in (1, 2, 5)]
    return [tick for tick in ticks if low <= tick <= high]


def profile_with_band(
    group: Group, limits: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Shares of a group's trials within some distances, and the ends of their intervals."""
    profile = [share_over_seeds(group.distances <= limit) for limit in limits]
    rates, low, high = np.array([(share.value, *(share.ci95 or ())) for share in profile]).T
    return rates, low, high


def histogram_chart(results: ProblemResults) -> Drawing:
    """Draw the histograms of a problem below each other, all on the same scales.

    The height of a bar is the square root of its share, so that rare failures can be seen.
    """
    rows = len(results.groups)
    furthest = max(float(group.distances.max()) for group in results.groups)
    edges = np.arange(0.0, furthest + 2 * BIN_WIDTH, BIN_WIDTH)
    # Rows share the height of a profile, as long as that is enough.
    figure, axes = _chart(rows * max(48, 270 // rows) + BELOW, above=0)
    axes.set(xlim=edges[[0, -1]], ylim=(0, rows))
    spacing = 0.2 if edges[-1] < 2 else 0.5 * np.ceil(edges[-1] / 5)
    axes.set_xticks(np.arange(0, edges[-1], spacing))
    axes.xaxis.set_major_formatter("{x:g}")
    firsts = [f"{100 * bin_shares(group, edges)[0]:.1f} %" for group in results.groups]
    axes.set_yticks(range(rows), firsts[::-1], va="bottom")
    _finish(axes, results.tolerance, "final distance to the goal [m]")
    for row, group in enumerate(reversed(results.groups)):
        shares = bin_shares(group, edges)
        bars = axes.bar(
            edges[:-1], ROW_HEIGHT * np.sqrt(shares), 0.95 * BIN_WIDTH, row, align="edge"
        )
        for bar, low, share in zip(bars, edges, shares, strict=False):
            if share:
                title = f"{low:.2f} to {low + BIN_WIDTH:.2f} m: {100 * share:.2f} % of trials"
                style(bar, "bars", group, title)
        name = axes.text(edges[-1], row + 0.5, group.name, fontsize=12, ha="right")
        style(name, "name end", group)
    named = (f"{group.name} {first}" for group, first in zip(results.groups, firsts, strict=True))
    return draw(
        figure,
        f"Histograms of the final distance on {results.name}. Share of trials in the first bin, "
        f"below {BIN_WIDTH:g} m: " + "; ".join(named),
    )


def bin_shares(group: Group, edges: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of a group's trials, of all seeds alike, that ended in each bin, shape (n,).

    Every bin is open at its upper edge [m], but the last.
    """
    counts, _ = np.histogram(group.distances, edges)
    shares: NDArray[np.float64] = counts / group.distances.size
    return shares
