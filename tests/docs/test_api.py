"""The API reference names everything that the packages export."""

import re
from importlib import import_module
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
REFERENCE = (DOCS / "reference" / "api.rst").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "package", ["kinarm", "kinarm.envs", "kinarm.viewer", "kinarm.policies", "kinarm.evaluation"]
)
def test_exported_names_are_documented(package: str) -> None:
    documented = set(
        re.findall(r"^\.\. (?:auto|py:)\w+:: (?:[\w.]+\.)?(\w+)$", REFERENCE, re.MULTILINE)
    )
    exported = set(import_module(package).__all__)
    assert exported - documented == set()
