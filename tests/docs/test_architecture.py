"""The page that says how kinarm is built is true to the code."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = ("explanation/architecture.md", "how-to/extending.md")
ROOMS = ("kinarm", "policies", "evaluation")


@pytest.mark.parametrize("page", PAGES)
def test_modules_that_a_page_names_exist(page: str) -> None:
    named = re.findall(r"`([\w/]+\.py)`", (ROOT / "docs" / page).read_text(encoding="utf-8"))
    assert len(named) > 3
    assert [name for name in named if not (ROOT / name).is_file()] == []


def test_functions_that_the_page_names_exist() -> None:
    text = (ROOT / "docs" / PAGES[0]).read_text(encoding="utf-8")
    sources = "\n".join(
        path.read_text(encoding="utf-8")
        for folder in ROOMS
        for path in (ROOT / folder).rglob("*.py")
    )
    named = set(re.findall(r"`(?:\w+\.)?([a-zA-Z_]{4,})`", text)) - {"episodes", *ROOMS}
    for name in named:
        assert re.search(rf"\b(def|class) {name}\b|^{name}\b", sources, re.MULTILINE), name
