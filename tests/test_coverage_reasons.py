"""Whatever is left out of the measured coverage says why, next to where it is left out."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PYPROJECT = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
COVERAGE = tomllib.loads(PYPROJECT)["tool"]["coverage"]
SOURCES = [
    path for folder in COVERAGE["run"]["source_dirs"] for path in (ROOT / folder).rglob("*.py")
]
LEFT_OUT = [*COVERAGE["run"]["omit"], *COVERAGE["report"]["exclude_also"]]
REASON = r"(?:\S+ ){2,}\S+"
"""Three words at least."""

PRAGMA = re.compile(rf"#\s*pragma:\s*no\s*(?:cover|branch)(?P<reason> - {REASON})?")


def test_every_pragma_has_a_reason():
    without = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in SOURCES
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1)
        for pragma in PRAGMA.finditer(line)
        if not pragma["reason"]
    ]
    assert not without


@pytest.mark.parametrize("left_out", LEFT_OUT)
def test_every_entry_has_a_reason(left_out):
    (line,) = (line for line in PYPROJECT.splitlines() if left_out in line)
    assert re.search(rf",\s*# {REASON}$", line), line


@pytest.mark.parametrize("pattern", COVERAGE["run"]["omit"])
def test_every_entry_leaves_something_out(pattern):
    assert any(path in SOURCES for path in ROOT.glob(pattern))


@pytest.mark.parametrize("pattern", COVERAGE["report"]["exclude_also"])
def test_every_pattern_leaves_something_out(pattern):
    assert any(re.search(pattern, path.read_text(encoding="utf-8")) for path in SOURCES)


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("pass  # pragma: no cover", None),
        ("pass  # pragma: no branch - because", None),
        ("pass  #pragma:no cover", None),
        ("pass  # pragma: no cover - another system's way", " - another system's way"),
    ],
)
def test_what_counts_as_a_reason(line, reason):
    assert PRAGMA.search(line)["reason"] == reason
