"""What names the version of kinarm names the same one."""

import re
from pathlib import Path

import pytest

import kinarm

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    ("file", "statement"),
    [
        ("CITATION.cff", r"^version: (\S+)$"),
        ("README.md", r"^  version = \{(\S+)\},$"),
        ("CHANGELOG.md", r"^## (\d\S*) - \d{4}-\d\d-\d\d$"),
    ],
)
def test_a_file_names_the_version(file, statement):
    said = (ROOT / file).read_text(encoding="utf-8")
    assert re.findall(statement, said, re.MULTILINE)[0] == kinarm.__version__
