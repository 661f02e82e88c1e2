"""Pages of the built site in a real browser: quiet, legible and no wider than the screen."""

import os
from itertools import product
from pathlib import Path

import pytest

REQUIRED = "KINARM_REQUIRE_SITE"
SITE = Path(__file__).resolve().parents[2] / "docs" / "_build" / "html"
SIZES = {"desktop": (1280, 900), "phone": (390, 844)}
CONTRAST = Path(__file__).with_name("contrast.js")
PAGES = (
    "index.html",
    "reference/command_lines.html",
    "how-to/troubleshooting.html",
    "reference/api/world.html",
)
"""The first, and those of most tables, code and definitions; one of most replays is below."""


@pytest.fixture(scope="module", autouse=True)
def _site() -> None:
    if not (SITE / "index.html").exists():
        if os.environ.get(REQUIRED) == "1":
            pytest.fail(f"{REQUIRED}=1, but the site is not built")
        pytest.skip("the site is not built: make docs")


@pytest.mark.parametrize(
    ("name", "size"), [*product(PAGES, SIZES), ("how-to/own_scene.html", "phone")]
)
def test_page_is_quiet_legible_and_fits(watch, name, size):
    width, height = SIZES[size]
    screen = {"viewport": {"width": width, "height": height}}
    # Replays stand still: drawing all of a page at once takes minutes without a graphics card.
    with watch(SITE / name, **screen, reduced_motion="reduce") as opened:
        assert opened.tell("document.documentElement.scrollWidth") <= width
        for scheme in ("light", "dark"):
            opened.page.emulate_media(color_scheme=scheme)
            contrast, where = opened.tell(CONTRAST.read_text())
            assert contrast >= 4.5, (name, scheme, where)
        assert opened.complaints == []
