"""The long run, in its shortest form."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_nothing_is_left_after_two_rounds(tmp_path):
    pytest.importorskip("torch")
    out = tmp_path / "endurance.json"
    command = [
        sys.executable,
        "-m",
        "tests.campaign.endurance",
        "--minutes",
        "0",
        "--out",
        str(out),
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    document = json.loads(out.read_text())
    assert document["incidents"] == [], done.stderr
    assert document["rounds"] == 2
    last = document["samples"][-1]
    assert (last["children"], last["ports"], last["outlasting"]) == (0, 1, 0)
