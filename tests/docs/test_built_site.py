"""The built site: every link leads somewhere, and nothing is fetched from elsewhere."""

import os
from pathlib import Path

import pytest
from built_site import SITE, Page, broken_links, site_pages

REQUIRED = "KINARM_REQUIRE_SITE"


@pytest.fixture(scope="module")
def pages() -> dict[Path, Page]:
    if not (SITE / "index.html").exists():
        if os.environ.get(REQUIRED) == "1":
            pytest.fail(f"{REQUIRED}=1, but the site is not built")
        pytest.skip("the site is not built: make docs")
    return site_pages()


@pytest.mark.slow
def test_every_link_and_anchor_leads_somewhere(pages):
    assert len(pages) > 20
    assert broken_links(pages) == []


def test_what_leads_nowhere_is_noticed(tmp_path):
    (tmp_path / "b.html").write_text('<p id="here">b</p>')
    links = ("b.html#here", "b.html#gone", "c.html", "#top", "https://example.org", "b.html")
    anchors = "".join(f'<a href="{link}">a</a>' for link in links)
    (tmp_path / "a.html").write_text(f"<h1 id='a'>a</h1>{anchors}<img src='p.png'>")
    found = broken_links({path: Page(path) for path in tmp_path.iterdir()})
    assert sorted(found) == [
        "a.html: #top",
        "a.html: b.html#gone",
        "a.html: c.html",
        "a.html: p.png",
    ]
