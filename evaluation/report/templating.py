"""Templates of all pages, and tables in Markdown."""

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Template


def template(name: str) -> "Template":
    """A template by its file's name; what is put into HTML is escaped."""
    from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

    environment = Environment(
        loader=PackageLoader(__package__),
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        autoescape=select_autoescape(),
    )
    environment.filters.update(
        log10=math.log10,
        tenth=lambda length: f"{length:.1f}".removesuffix(".0"),
        percent=lambda share: f"{100 * share:.1f} %",
        dashes=lambda text: text.replace("..", "\N{EN DASH}"),
    )
    return environment.get_template(name)


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Format a table of some columns."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"
