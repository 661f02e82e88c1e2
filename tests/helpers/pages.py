"""README and pages of the documentation, as they are written: their code, headings and links."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from docs.comments import BLOCK, FILE

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
MADE = ("_build",)

LINK = re.compile(r"\]\(<?([^)\s>]+)")
HEADING = re.compile(r"^#+ +(.+?) *$", re.M)


class Block(NamedTuple):
    """Fenced text of a page.

    Attributes
    ----------
    told : str
        First word of the comment before it, such as ``run``, ``name`` or ``code``, or none.
    about : str
        The words behind it.
    language : str
        Such as ``python`` or ``sh``.
    file : str
        File that the reader saves it as, or none.
    code : str
        The text.
    """

    told: str
    about: str
    language: str
    file: str
    code: str


def pages() -> dict[str, Path]:
    """Every page in Markdown, by its path from the root."""
    found = [*ROOT.glob("*.md"), *DOCS.rglob("*.md")]
    written = (path for path in found if not set(path.relative_to(ROOT).parts) & set(MADE))
    return {path.relative_to(ROOT).as_posix(): path for path in sorted(written)}


def blocks(path: Path) -> Iterator[Block]:
    """Fenced blocks of a page, in their order."""
    for match in BLOCK.finditer(path.read_text(encoding="utf-8")):
        told, _, about = (match["told"] or "").partition(" ")
        file = FILE.match(match["code"])
        yield Block(told, about, match["language"], file[1] if file else "", match["code"])


def named_blocks(path: Path) -> dict[str, str]:
    """Code that has a name, or that the reader saves as a file, by that name."""
    named = ((each.file or each.about, each) for each in blocks(path))
    return {name: each.code for name, each in named if each.file or each.told == "name"}


def links(path: Path) -> list[str]:
    """Targets of the links and pictures of a page."""
    return LINK.findall(BLOCK.sub("", path.read_text(encoding="utf-8")))


def anchors(path: Path) -> set[str]:
    """What links to a page may name behind a ``#``: headings in the spelling of GitHub."""
    text = BLOCK.sub("", path.read_text(encoding="utf-8"))
    named = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", "\n".join(HEADING.findall(text)))
    return {*re.sub(r"[^\w\- \n]", "", named.lower()).replace(" ", "-").split("\n")}
