"""The API reference names everything that the packages export."""

import re
from importlib import import_module
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES = {path.stem: path.read_text("utf-8") for path in (DOCS / "reference/api").glob("*.rst")}
ENTRY = re.compile(r"^\.\. (?:auto|py:)\w+:: (?:[\w.]+\.)?(\w+)$", re.MULTILINE)


@pytest.mark.parametrize(
    "package", ["kinarm", "kinarm.envs", "kinarm.viewer", "kinarm.policies", "kinarm.evaluation"]
)
def test_exported_names_are_documented(package: str) -> None:
    documented = {name for page in PAGES.values() for name in ENTRY.findall(page)}
    assert set(import_module(package).__all__) - documented == set()


def test_the_index_has_every_page() -> None:
    index = (DOCS / "reference" / "api.rst").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^\.\. kinarm-api:: reference/api/(\w+)$", index, re.MULTILINE)) == (
        sorted(re.findall(r"^   api/(\w+)$", index, re.MULTILINE))
    )
    assert set(re.findall(r"^   api/(\w+)$", index, re.MULTILINE)) == set(PAGES)
