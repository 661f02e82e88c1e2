"""Kernels work whatever happens to Numba's cache."""

import os
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


@pytest.fixture
def run(tmp_path):
    """Call a kernel in another process; says whether its machine code was found."""

    def call(*arguments):
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT, *arguments],
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
            capture_output=True,
            text=True,
            check=False,
            timeout=300,
        )
        assert (done.returncode, done.stderr) == (0, "")
        return int(done.stdout)

    return call


@pytest.mark.parametrize("ending", [".nbi", ".nbc"])
@pytest.mark.parametrize("content", [b"", b"nonsense", None])
def test_damaged_files_are_made_anew(run, tmp_path, ending, content):
    assert run() == 0
    assert run() == 1
    for path in tmp_path.rglob(f"*{ending}"):
        path.write_bytes(path.read_bytes()[:-7] if content is None else content)
    run()
    assert run() == 1


def test_a_full_disk_is_no_failure(run):
    assert run("full") == 0
    assert run("full") == 0
    assert run() == 0
    assert run() == 1
