"""What comments in pages tell the site: pages are plain Markdown, whose comments no reader sees.

``<!-- run -->`` on the line before a block of code has it run, and ``<!-- {toctree}`` up to
``-->`` is a directive of Sphinx. Blocks that name a file in their first line are what the reader
saves under that name. Names such as ``kinarm.ReachTask`` become links. Every line keeps its number.
"""

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

BLOCK = re.compile(
    r"^(?:<!-- (?P<told>.+) -->\n)?"
    r"(?P<fence>`{3,})(?P<language>.*)\n(?P<code>(?:.*\n)*?)(?P=fence)$",
    re.M,
)
"""A block of code, with the comment before it."""

FILE = re.compile(r"(?:#|<!--) ([\w./-]+\.\w+)(?: -->)?\n")
"""First line of a block that the reader saves as a file."""

DIRECTIVE = re.compile(r"^<!-- (\{[\w-]+\}.*)\n((?:.*\n)*?)-->$", re.M)
NAME = re.compile(r"(?<![`\[])(`kinarm(?:\.\w+)+`)(?!`)")


def for_site(page: str) -> str:
    """A page with directives and roles for its comments and names."""
    parts, end = [], 0
    for block in BLOCK.finditer(page):
        parts += [_text(page[end : block.start()]), _block(block)]
        end = block.end()
    return "".join([*parts, _text(page[end:])])


def _block(block: re.Match[str]) -> str:
    """A block, as the directive that runs it or writes its file if it is to."""
    word, *options = (block["told"] or "").split(maxsplit=1) or [""]
    if word != "run":
        if not FILE.match(block["code"]):
            return block[0]
        options = []
    words = " ".join(["{kinarm-run}", block["language"], *options])
    line = "\n" if block["told"] else ""
    return f"{line}{block['fence']}{words}\n{block['code']}{block['fence']}"


def _text(text: str) -> str:
    """What stands between blocks."""
    return NAME.sub(r"{py:obj}\1", DIRECTIVE.sub(r"```\1\n\2```", text))


def _read(_app: "Sphinx", _page: str, source: list[str]) -> None:
    source[0] = for_site(source[0])


def setup(app: "Sphinx") -> dict[str, bool]:
    """Have pages read so."""
    app.connect("source-read", _read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
