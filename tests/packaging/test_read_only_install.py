"""Where kinarm's own folder cannot be written, compiled kernels are kept in the user's cache."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCREEN = """
import numpy as np
from kinarm.kernels.screening import screen
from kinarm.world import World
World("right").screen(np.zeros((1, 6)))
print(screen.stats.cache_path, sum(screen.stats.cache_hits.values()))
"""


@pytest.fixture
def read_only_install(tmp_path):
    """A copy of the package in which nothing can be compiled into.

    A file where the folder of compiled modules would be keeps the superuser from it, too.
    """
    site = tmp_path / "site"
    unwanted = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "kinarm", site / "kinarm", ignore=unwanted)
    shutil.copytree(ROOT / "data", site / "kinarm" / "data", ignore=unwanted)
    for folder in (site, *(path for path in site.rglob("*") if path.is_dir())):
        (folder / "__pycache__").touch()
        folder.chmod(0o555)
    yield site
    for folder in (site, *(path for path in site.rglob("*") if path.is_dir())):
        folder.chmod(0o755)


@pytest.mark.rare
def test_later_processes_find_what_the_first_compiled(read_only_install, tmp_path):
    home = tmp_path / "home"
    chosen = ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")
    environment = {name: value for name, value in os.environ.items() if name not in chosen}
    environment |= {"HOME": str(home), "PYTHONPATH": str(read_only_install)}

    def run():
        command = [sys.executable, "-P", "-c", SCREEN]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
        )
        path, hits = done.stdout.split()
        return Path(path), int(hits)

    first, second = run(), run()
    assert first[0].is_relative_to(home / ".cache" / "numba")
    assert first[1] == 0
    assert second == (first[0], 1)
