"""Pages of the built site in a real browser: quiet, legible and no wider than the screen."""

from itertools import product
from pathlib import Path

import pytest
from built_site import SITE, Page, site_pages

SIZES = {"desktop": (1280, 900), "phone": (390, 844)}
CONTRAST = Path(__file__).with_name("contrast.js")


def count(*tags: str):
    """How often tags are on a page."""
    return lambda page: sum(page.tags[tag] for tag in tags)


CHOSEN = {
    "the first": lambda page: page.path == SITE / "index.html",
    "most tables": count("table"),
    "most code": count("pre"),
    "most replays": count("iframe"),
    "most definitions": count("dl"),
}
"""What five pages are chosen by: the one with the most of it."""


@pytest.fixture(scope="module")
def pages() -> list[Page]:
    found = list(site_pages().values())
    if not found:
        pytest.skip("the site is not built: make docs")
    return found


@pytest.mark.parametrize(
    ("chosen", "size"),
    [
        *product([each for each in CHOSEN if each != "most replays"], SIZES),
        ("most replays", "phone"),
    ],
)
def test_page_is_quiet_legible_and_fits(new_context, pages, chosen, size):
    page = max(pages, key=CHOSEN[chosen])
    width, height = SIZES[size]
    screen = {"viewport": {"width": width, "height": height}}
    # Replays stand still: drawing all of a page at once takes minutes without a graphics card.
    context = new_context(**screen, reduced_motion="reduce")
    try:
        opened, complaints = context.new_page(), []
        opened.on("pageerror", lambda error: complaints.append(str(error)))
        opened.on("console", lambda said: said.type == "error" and complaints.append(said.text))
        opened.goto(page.path.as_uri())
        assert opened.evaluate("document.documentElement.scrollWidth") <= width
        for scheme in ("light", "dark"):
            opened.emulate_media(color_scheme=scheme)
            contrast, where = opened.evaluate(CONTRAST.read_text())
            assert contrast >= 4.5, (page.path.name, scheme, where)
        assert complaints == []
    finally:
        context.close()
