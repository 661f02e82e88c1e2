"""Compiled for AVX2, kernels give the same bits, and take as many instructions as recorded."""

import json
import platform
import shutil

import pytest
from computed_bits import computed_bits, usual_bits
from count import RECORDED, TARGET, changes, counted, read_count

ANEW = "python tests/instructions/count.py --record"
TOLERANCE, INTERPRETED = 0.05, 0.1
"""How far a section of kernels may be off, and one with much of Python, whose builds differ."""


of_x86_64 = pytest.mark.skipif(platform.machine() != "x86_64", reason="counted on x86-64")


@pytest.mark.slow
@of_x86_64
def test_bits_are_those_of_this_processor():
    """What is compiled for it here is counted below."""
    assert computed_bits(TARGET) == usual_bits()


@pytest.mark.slow
@of_x86_64
@pytest.mark.skipif(shutil.which("valgrind") is None, reason="needs valgrind (apt-get install it)")
def test_instructions_are_those_recorded():
    found = changes(json.loads(RECORDED.read_text()), counted())
    allowed = {"batch environment": INTERPRETED}
    more = {
        name: f"{change:+.1%}"
        for name, change in found.items()
        if abs(change) > allowed.get(name, TOLERANCE)
    }
    assert not more, f"other numbers of instructions; if that is meant, {ANEW}"


def test_change_of_a_section():
    found = changes({"a": 100, "b": 10, "gone": 1}, {"a": 103, "b": 5, "new": 1})
    assert found == pytest.approx({"a": 0.03, "b": -0.5, "gone": 1.0, "new": 1.0})


def test_section_is_read_from_callgrinds_output(tmp_path):
    file = tmp_path / "counts.1"
    file.write_text("version: 1\ndesc: Trigger: Client Request: some work\nsummary: 12\nfn=(1)\n")
    assert read_count(file) == ("some work", 12)
    file.write_text("version: 1\n")
    with pytest.raises(ValueError, match="counts.1"):
        read_count(file)
