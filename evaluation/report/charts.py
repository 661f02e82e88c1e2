"""Charts of a problem: Matplotlib works out where everything lies, the style sheet how it looks.

A point of a figure is a unit of the page.
"""

import io
import json
import re
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.figures import BIN_WIDTH
from kinarm.evaluation.metrics import LIMITS
from kinarm.evaluation.report.groups import Group, ProblemResults
from kinarm.evaluation.statistics import share_over_seeds

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH, LEFT, RIGHT, BELOW = 460, 46, 12, 44
"""Size of a chart and of its margins [points]."""

PROFILE_HEIGHT, POINTS = 330, 121
"""Height of a profile, and the distances at which it is drawn beside those of the table."""

ROW_HEIGHT = 0.76
"""Of the tallest bar of a histogram, of the height of its row."""

SVG = "{http://www.w3.org/2000/svg}"


def profile_chart(results: ProblemResults) -> str:
    """Draw the profiles of a problem with their 95 % bands, the oracle's as well, as SVG."""
    from matplotlib.ticker import LogLocator

    limits = profile_limits(results)
    figure, axes = _chart(PROFILE_HEIGHT, above=14)
    axes.set(xscale="log", xlim=limits[[0, -1]], ylim=(0, 1))
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.set_xticks([], minor=True)
    axes.set_yticks([0, 0.25, 0.5, 0.75, 1])
    axes.yaxis.set_major_formatter(lambda share, _: f"{100 * share:g} %")
    _finish(axes, results.tolerance, "distance d to the goal [m], logarithmic")
    for place, group in enumerate(reversed(results.groups)):  # the best comes last, on top
        shares = [share_over_seeds(group.distances <= limit) for limit in limits]
        rates, low, high = np.array([(share.value, *(share.ci95 or ())) for share in shares]).T
        (band,) = axes.fill([*limits, *limits[::-1]], [*high, *low[::-1]], clip_on=False)
        (line,) = axes.plot(limits, rates, clip_on=False)
        for artist, part in ((band, "band"), (line, "line")):
            artist.set_zorder(3 + place)
            _style(artist, part, group, title=group.name)
    within = "; ".join(
        f"{group.name}: {100 * float((group.distances <= results.tolerance).mean()):.1f} %"
        for group in results.groups
    )
    return _draw(
        figure,
        f"Performance profiles on {results.name}. Share of trials within {results.tolerance:g} m: "
        + within,
    )


def profile_limits(results: ProblemResults) -> NDArray[np.float64]:
    """Distances at which the profiles of a problem are drawn [m], ascending."""
    furthest = max(float(group.distances.max()) for group in results.groups)
    low, high = results.tolerance / 5, max(furthest, 2 * results.tolerance)
    named = [limit for limit in (results.tolerance, *LIMITS) if low <= limit <= high]
    return np.unique(np.concatenate([np.geomspace(low, high, POINTS), named]))


def histogram_chart(results: ProblemResults) -> str:
    """Draw the histograms of a problem below each other, all on the same scales, as SVG.

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
    counts = [np.histogram(group.distances, edges)[0] for group in results.groups]
    shares = [n / group.distances.size for n, group in zip(counts, results.groups, strict=True)]
    firsts = [f"{100 * share[0]:.1f} %" for share in shares]
    axes.set_yticks(range(rows), firsts[::-1], va="bottom")
    _finish(axes, results.tolerance, "final distance to the goal [m]")
    for row, (group, own) in enumerate(zip(results.groups[::-1], shares[::-1], strict=True)):
        heights = ROW_HEIGHT * np.sqrt(own)
        bars = axes.bar(edges[:-1], heights, 0.95 * BIN_WIDTH, row, align="edge")
        for bar, low, share in zip(bars, edges, own, strict=False):
            if share:
                title = f"{low:.2f} to {low + BIN_WIDTH:.2f} m: {100 * share:.2f} % of trials"
                _style(bar, "bars", group, title)
        name = axes.text(edges[-1], row + 0.5, group.name, fontsize=12, ha="right")
        _style(name, "name end", group)
    named = (f"{group.name} {first}" for group, first in zip(results.groups, firsts, strict=True))
    return _draw(
        figure,
        f"Histograms of the final distance on {results.name}. Share of trials in the first bin, "
        f"below {BIN_WIDTH:g} m: " + "; ".join(named),
    )


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
    axes.xaxis.set_major_formatter("{x:g}")
    _style(axes.axvline(tolerance, clip_on=False), "tolerance")
    _style(axes.set_xlabel(title, fontsize=12, labelpad=4), "tick middle")
    for axis, classes in ((axes.xaxis, "tick middle"), (axes.yaxis, "tick end")):
        for line in axis.get_gridlines():
            _style(line, "grid")
        for label in axis.get_ticklabels():
            _style(label, classes)


def _style(artist: "Artist", classes: str, group: Group | None = None, title: str = "") -> None:
    """Leave an artist to the style sheet, as a part of a policy, with words at the pointer."""
    series = {"class": f"series {group.style}", "data-series": group.name} if group else {}
    artist.set_gid(json.dumps((classes, series, title)))


def _draw(figure: "Figure", description: str) -> str:
    """SVG of the paths and texts of a figure that `_style` was called for."""
    import matplotlib

    written = io.StringIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "path.simplify_threshold": 0.05}):
        figure.savefig(written, format="svg", dpi=72)
    width, height = (72 * float(inches) for inches in figure.get_size_inches())
    page = {"viewBox": f"0 0 {width:g} {height:g}", "class": "chart", "role": "img"}
    drawing = ElementTree.Element("svg", {**page, "aria-label": description})
    for drawn in ElementTree.fromstring(written.getvalue()).iter(f"{SVG}g"):
        if drawn.get("id", "").startswith("["):
            classes, series, title = json.loads(drawn.get("id", ""))
            parent = ElementTree.SubElement(drawing, "g", series)
            for shape in (*drawn.findall(f"{SVG}path"), *drawn.findall(f"{SVG}text")):
                places = {name: _rounded(shape.get(name, "")) for name in ("d", "x", "y")}
                looks = {"class": classes, **{name: at for name, at in places.items() if at}}
                kept = ElementTree.SubElement(parent, shape.tag.removeprefix(SVG), looks)
                kept.text = (shape.text or "").strip()
                if title:
                    ElementTree.SubElement(kept, "title").text = title
    return ElementTree.tostring(drawing, encoding="unicode")


def _rounded(coordinates: str) -> str:
    """Coordinates to a tenth, which no eye can tell apart."""
    short = re.sub(r"-?\d+\.\d+", lambda number: f"{float(number[0]):.1f}", coordinates)
    return re.sub(r"\s*([A-Za-z])\s*", r"\1", " ".join(short.split())).replace(".0", "")
