"""README and pages of the documentation, as they are written: their code, headings and links."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
MADE = ("_build", "gallery")

FENCED = re.compile(r"^(?P<fence>`{3,}|:{3,})(?P<info>.*)\n(?P<body>(?:.*\n)*?)(?P=fence)$", re.M)
INFO = re.compile(r"(?:\{(?P<directive>[\w-]+)\})? *(?P<language>\S*)")
OPTION = re.compile(r"^:([\w-]+): *(.*)\n", re.M)
LINK = re.compile(r"\]\(<?([^)\s>]+)")
HEADING = re.compile(r"^#+ +(.+?) *$", re.M)
LABEL = re.compile(r"^\((\S+)\)=$", re.M)


class Block(NamedTuple):
    """Fenced text of a page.

    Attributes
    ----------
    directive : str
        What reads it, such as ``kinarm-run``; empty for plain code.
    language : str
        Such as ``python`` or ``sh``.
    options : dict
        Options of the directive.
    code : str
        The text.
    """

    directive: str
    language: str
    options: dict[str, str]
    code: str


def pages() -> dict[str, Path]:
    """Every page in Markdown, by its path from the root."""
    found = [*ROOT.glob("*.md"), *DOCS.rglob("*.md")]
    written = (path for path in found if not set(path.relative_to(ROOT).parts) & set(MADE))
    return {path.relative_to(ROOT).as_posix(): path for path in sorted(written)}


def blocks(path: Path) -> Iterator[Block]:
    """Fenced blocks of a page, in their order."""
    for match in FENCED.finditer(path.read_text(encoding="utf-8")):
        info = INFO.match(match["info"])
        body, options = match["body"], {}
        while info["directive"] and (option := OPTION.match(body)):
            options[option[1]] = option[2]
            body = body[option.end() :]
        yield Block(info["directive"] or "", info["language"], options, body.lstrip("\n"))


def links(path: Path) -> list[str]:
    """Targets of the links and pictures of a page."""
    return LINK.findall(FENCED.sub("", path.read_text(encoding="utf-8")))


def anchors(path: Path) -> set[str]:
    """What links to a page may name behind a ``#``: headings in the spelling of GitHub, labels."""
    text = FENCED.sub("", path.read_text(encoding="utf-8"))
    named = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", "\n".join(HEADING.findall(text)))
    kept = re.sub(r"[^\w\- \n]", "", named.lower()).replace(" ", "-")
    return {*kept.split("\n"), *LABEL.findall(text)}
