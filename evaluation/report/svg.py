"""Matplotlib's drawings as parts of a page, whose style sheet gives them their looks."""

import io
import json
import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple
from xml.etree import ElementTree

from kinarm.evaluation.report.groups import Group

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

SVG = "{http://www.w3.org/2000/svg}"


class Shape(NamedTuple):
    """A path, or a text and its place, of a drawing.

    It has classes of the style sheet; the name of the policy that it belongs to, or empty, and
    the classes that tell that apart; and what is said where the pointer is, or empty.
    """

    classes: str
    series: str
    colour: str
    title: str
    path: str = ""
    text: str = ""
    x: str = ""
    y: str = ""


class Drawing(NamedTuple):
    """A figure as a page shows it: its size, its shapes from the lowest to the topmost.

    The description says what it shows, for those who cannot see it.
    """

    width: float
    height: float
    shapes: list[Shape]
    description: str


def style(artist: "Artist", classes: str, group: Group | None = None, title: str = "") -> None:
    """Leave the looks of an artist to the style sheet.

    Parameters
    ----------
    artist : Artist
        The artist.
    classes : str
        Of the style sheet.
    group : Group, optional
        The policy that it belongs to.
    title : str
        What is said where the pointer is.
    """
    series, colour = (group.name, group.style) if group else ("", "")
    artist.set_gid(json.dumps((classes, series, colour, title)))


def draw(figure: "Figure", description: str) -> Drawing:
    """Let Matplotlib work out where everything lies.

    A point of the figure is a unit of the page. Only what `style` was called for is kept.
    """
    import matplotlib

    written = io.StringIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "path.simplify_threshold": 0.05}):
        figure.savefig(written, format="svg", dpi=72)
    groups = ElementTree.fromstring(written.getvalue()).iter(f"{SVG}g")
    styled = [group for group in groups if group.get("id", "").startswith("[")]
    width, height = (72 * float(inches) for inches in figure.get_size_inches())
    return Drawing(
        width, height, [shape for each in styled for shape in _shapes(each)], description
    )


def _shapes(group: ElementTree.Element) -> Iterator[Shape]:
    """Paths and texts of a styled artist."""
    classes, series, colour, title = json.loads(group.get("id", ""))
    for element in group:
        if element.tag == f"{SVG}path":
            path = _rounded(element.get("d", ""))
            yield Shape(classes, series, colour, title, path=path)
        elif element.tag == f"{SVG}text":
            x, y = (_rounded(element.get(name, "")) for name in ("x", "y"))
            yield Shape(classes, series, colour, title, text=element.text or "", x=x, y=y)


def _rounded(coordinates: str) -> str:
    """Coordinates to a tenth, which no eye can tell apart."""
    short = re.sub(r"-?\d+\.\d+", lambda number: f"{float(number[0]):.1f}", coordinates)
    return re.sub(r"\s*([A-Za-z])\s*", r"\1", " ".join(short.split())).replace(".0", "")
