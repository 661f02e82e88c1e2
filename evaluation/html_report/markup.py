"""HTML and SVG from Python calls; text is escaped unless it is markup already."""

from collections.abc import Iterable
from html import escape
from typing import TypeAlias


class Markup(str):
    """Text that is HTML or SVG already."""

    __slots__ = ()


Child: TypeAlias = "str | Iterable[Child] | None"
"""What an element can hold: markup, text to escape, nothing, or several of these."""

Attribute: TypeAlias = "str | float | None"

DASH = "\N{EN DASH}"
"""Between the ends of a range."""

VOID = {"br", "col"}
"""Elements of HTML that have no end."""


def tag(name: str, *children: Child, **attributes: Attribute) -> Markup:
    """Write an element.

    Parameters
    ----------
    name : str
        Name of the element.
    *children
        Its content.
    **attributes
        A trailing underscore is dropped and others become hyphens (``class_``, ``aria_label``);
        None leaves an attribute out.
    """
    written = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{_attribute(value)}"'
        for key, value in attributes.items()
        if value is not None
    )
    if name in VOID:
        return Markup(f"<{name}{written}>")
    return Markup(f"<{name}{written}>{join(*children)}</{name}>")


def join(*children: Child) -> Markup:
    """Write several pieces of content one after the other."""
    return Markup("".join(_text(child) for child in children))


def _text(child: Child) -> str:
    if child is None or isinstance(child, Markup):
        return child or ""
    return escape(child, quote=False) if isinstance(child, str) else join(*child)


def _attribute(value: str | float) -> str:
    return escape(value) if isinstance(value, str) else number(value)


def number(value: float) -> str:
    """Write a coordinate to a tenth, which no eye can tell apart."""
    text = f"{value:.1f}".removesuffix(".0")
    return "0" if text == "-0" else text


def points(xs: Iterable[float], ys: Iterable[float]) -> str:
    """Write a line through points, as the start of a path."""
    pairs = (f"{number(x)},{number(y)}" for x, y in zip(xs, ys, strict=True))
    return "M" + "L".join(pairs)
