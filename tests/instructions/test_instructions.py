"""Compiled for AVX2, kernels give the same bits, and take as many instructions as recorded."""

import json
import platform
import shutil

import pytest
from computed_bits import computed_bits, usual_bits
from count import RECORDED, TARGET, changes, counted

ANEW = "python tests/instructions/count.py --record"
TOLERANCE, INTERPRETED = 0.05, 0.1
"""How far a section of kernels may be off, and one with much of Python, whose builds differ."""


of_x86_64 = pytest.mark.skipif(platform.machine() != "x86_64", reason="counted on x86-64")


@pytest.mark.rare
@of_x86_64
def test_bits_are_those_of_this_processor():
    assert computed_bits(TARGET) == usual_bits()


@pytest.mark.rare
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
