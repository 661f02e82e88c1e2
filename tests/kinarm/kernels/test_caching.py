"""Kernels work whatever happens to Numba's cache."""

import os
import shutil
import subprocess
import sys

import pytest

SCRIPT = """
import resource, sys
import numpy as np
if "full" in sys.argv:
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
from kinarm.kernels.starting import propose_starts
rows = np.arange(2)
starts = propose_starts(rows, np.full((2, 3), 0.5), np.zeros(3), np.ones(3), np.zeros((2, 3)))
assert (starts == 0.5).all()
print(sum(propose_starts.stats.cache_hits.values()))
"""


def found(folder, *arguments):
    """Call a kernel in another process; says whether its machine code was found in a folder."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, *arguments],
        env={**os.environ, "NUMBA_CACHE_DIR": str(folder)},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert (done.returncode, done.stderr) == (0, "")
    return int(done.stdout)


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """A cache that was to be filled twice while the disk was full, and what was found there."""
    folder = tmp_path_factory.mktemp("filled")
    return folder, [found(folder, *full) for full in (["full"], ["full"], [], [])]


def test_a_full_disk_is_no_failure(filled):
    assert filled[1] == [0, 0, 0, 1]


@pytest.mark.parametrize("ending", [".nbi", ".nbc"])
@pytest.mark.parametrize("content", [b"", b"nonsense", None])
def test_damaged_files_are_made_anew(filled, tmp_path, ending, content):
    folder = shutil.copytree(filled[0], tmp_path / "damaged")
    damaged = list(folder.rglob(f"*{ending}"))
    assert damaged
    for path in damaged:
        path.write_bytes(path.read_bytes()[:-7] if content is None else content)
    found(folder)
    assert found(folder) == 1
