"""Templates of all pages, and tables in Markdown."""

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment


def template_environment(**settings: Any) -> "Environment":
    """Jinja's ``Environment`` for all templates, with these settings."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader(__package__),
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        **settings,
    )
    environment.filters.update(
        log10=math.log10,
        tenth=lambda length: f"{length:.1f}".removesuffix(".0"),
        percent=lambda share: f"{100 * share:.1f} %",
        dashes=lambda text: text.replace("..", "\N{EN DASH}"),
    )
    return environment


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Format a table of some columns."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"
