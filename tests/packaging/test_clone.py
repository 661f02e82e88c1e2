"""Sub-packages can be imported at the root of a clone and elsewhere, installed or not."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SHOW = """
import kinarm.data, kinarm.evaluation, kinarm.policies
for package in (kinarm.data, kinarm.evaluation, kinarm.policies):
    print(package.__file__)
"""


@pytest.mark.parametrize("place", ["root", "elsewhere", "path"])
def test_sub_packages_are_found(place, tmp_path):
    """At the root, with the installation elsewhere, and by ``PYTHONPATH`` alone."""
    done = subprocess.run(
        [sys.executable, "-c", SHOW],
        cwd=ROOT if place == "root" else tmp_path,
        env={**os.environ, **({"PYTHONPATH": str(ROOT)} if place == "path" else {})},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    folders = [Path(line).resolve().parent for line in done.stdout.split()]
    assert [folder.name for folder in folders] == ["data", "evaluation", "policies"]
    if place != "elsewhere":
        assert {folder.parent for folder in folders} == {ROOT}
