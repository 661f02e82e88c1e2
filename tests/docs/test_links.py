"""Links of README and pages lead to files and headings that are there."""

from pathlib import Path

import pytest
from pages import anchors, links, pages

PAGES = pages()
OUTSIDE = ("https://", "http://", "mailto:")

COMMANDS = "<!-- {kinarm-commands}"
"""On a page with it, headings are made by the build, which fails on links to others."""


def has_anchor(page: Path, anchor: str) -> bool:
    """Whether a page has a heading, or may get it from the build."""
    return anchor in anchors(page) or COMMANDS in page.read_text()


def broken(path: Path) -> list[str]:
    """Links of a page that lead nowhere."""
    found = []
    for link in links(path):
        file, _, anchor = link.partition("#")
        target = (path.parent / file).resolve() if file else path
        if link.startswith(OUTSIDE):
            continue
        if not target.exists() or (anchor and not has_anchor(target, anchor)):
            found.append(link)
    return found


def test_pages_are_found():
    assert {"README.md", "CHANGELOG.md", "docs/index.md"} <= PAGES.keys()
    assert len([link for path in PAGES.values() for link in links(path)]) > 100


@pytest.mark.parametrize("name", PAGES)
def test_links_lead_somewhere(name):
    assert broken(PAGES[name]) == []
