"""The built site, as files: every page with its links and what they can name."""

from collections import Counter
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

SITE = Path(__file__).resolve().parents[2] / "docs" / "_build" / "html"


class Page(HTMLParser):
    """A page of the site.

    Attributes
    ----------
    links : list of str
        What it refers to: links, pictures, scripts, style sheets.
    names : set of str
        What a link to it may name behind a ``#``.
    tags : Counter
        How often each tag is on it.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path, self.links, self.names = path, list[str](), set[str]()
        self.tags = Counter[str]()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Count a tag, and collect what its attributes name and refer to."""
        self.tags[tag] += 1
        for name, value in attrs:
            if name == "id" and value:
                self.names.add(value)
            elif name in ("href", "src") and value:
                self.links.append(value)


def site_pages() -> dict[Path, Page]:
    """Every page of the site, by its file."""
    return {
        path: Page(path) for path in sorted(SITE.rglob("*.html")) if "_static" not in path.parts
    }


def broken_links(pages: dict[Path, Page]) -> list[str]:
    """Links between pages, or to their files, that lead nowhere."""
    found = []
    for page in pages.values():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (page.path.parent / unquote(parts.path)).resolve() if parts.path else page.path
            named = unquote(parts.fragment)
            missing = named and target in pages and named not in pages[target].names
            if missing or not target.exists():
                found.append(f"{page.path.name}: {link}")
    return found
