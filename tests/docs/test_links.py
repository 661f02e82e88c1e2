"""Links of README and pages lead to files and headings that are there."""

from pathlib import Path

import pytest
from pages import anchors, links, pages

PAGES = pages()
OUTSIDE = ("https://", "http://", "mailto:")

COMMANDS = "<!-- {kinarm-commands}"
"""On a page with it, headings are made by the build: see `test_built_site.py` for their anchors."""


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


def test_what_leads_nowhere_is_noticed(tmp_path):
    (tmp_path / "other.md").write_text("# Units: [rad], `q`\n")
    page = tmp_path / "page.md"
    page.write_text(
        "# Top\n[a](other.md#units-rad-q) [b](#top) ![d](missing.png)\n"
        "[e](other.md#none) [f](#label) [g](https://example.org)\n```\n[h](code.md)\n```\n"
    )
    assert broken(page) == ["missing.png", "other.md#none", "#label"]
