"""Kernels are found in Numba's cache if nothing has changed, and work whatever happens to it."""

import os
import subprocess
import sys
from pathlib import Path

SCRIPT = """
import resource, sys
import numpy as np
if "full" in sys.argv:
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
from kinarm.kernels.distance import distances_from_hull
distances = np.zeros(2)
distances_from_hull(np.zeros((1, 3)), np.ones((2, 3)), distances)
assert (distances > 1).all()
print(sum(distances_from_hull.stats.cache_hits.values()))
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


def test_whatever_happens_to_the_files_kernels_work(tmp_path):
    """A full disk leaves none; damaged ones, and a flipped bit of machine code, are noticed."""
    assert [found(tmp_path, *full) for full in (["full"], [])] == [0, 0]

    (path,) = tmp_path.rglob("*.nbc")
    content = bytearray(path.read_bytes())
    # In the middle of an operation: unnoticed, the kernel would run and compute something else.
    content[content.index(b"\x7fELF") + 256] ^= 1
    path.write_bytes(content)
    assert found(tmp_path) == 0

    for path in (damaged := [path for path in tmp_path.rglob("*.nb*") if path.is_file()]):
        path.write_bytes(path.read_bytes()[:-7])
    assert damaged
    assert [found(tmp_path) for _ in range(2)] == [0, 1]


SOURCES = {
    "constants.py": "FACTOR = 2.0\n",
    "kernels/inner.py": """
from kinarm.kernels.compiling import inlined

@inlined
def plus(x):
    return x + 1.0
""",
    "kernels/outer.py": """
from arm.constants import FACTOR
from arm.kernels.middle import scaled
from kinarm.kernels.compiling import kernel

@kernel
def value(x):
    return FACTOR * scaled(x)
""",
    "kernels/middle.py": """
from arm.kernels.inner import plus
from kinarm.kernels.compiling import inlined

@inlined
def scaled(x):
    return 10.0 * plus(x)
""",
    "kernels/other.py": "",
    "kernels/__init__.py": "",
    "__init__.py": "",
}


def test_machine_code_is_as_fresh_as_all_that_is_compiled_in(tmp_path):
    """A package of kernels is changed, file by file; nothing but what changes is compiled anew."""
    package = tmp_path / "arm"
    for name, text in SOURCES.items():
        (package / name).parent.mkdir(parents=True, exist_ok=True)
        (package / name).write_text(text)

    def value_of_one(old="", new="", file="__init__.py"):
        """The kernel's value for 1 after a change, and whether it was in the cache."""
        path = package / file
        path.write_text(path.read_text().replace(old, new) if old else path.read_text() + new)
        asked = "print(value(1.0), value.stats.cache_hits.total())"
        ask = f"from arm.kernels.outer import value; {asked}"
        done = subprocess.run(
            [sys.executable, "-c", ask],
            env={
                **os.environ,
                "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
                "PYTHONPATH": str(tmp_path),
            },
            capture_output=True,
            text=True,
            check=True,
            cwd=Path(__file__).parent,
        )
        number, hits = done.stdout.split()
        return float(number), hits == "1"

    assert value_of_one() == (40.0, False)
    assert value_of_one(new="UNUSED = 1\n", file="kernels/other.py") == (40.0, True)
    assert value_of_one("1.0", "2.0", "kernels/inner.py") == (60.0, False)
    assert value_of_one("2.0", "3.0", "constants.py") == (90.0, False)


def test_versions_of_numba_that_are_not_known_are_refused_in_one_line():
    faked = "import numba; numba.version_info = numba.version_info._replace(short=(0, 99))"
    done = subprocess.run(
        [sys.executable, "-c", f"{faked}\nimport kinarm.kernels"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert "pip install 'numba<" in done.stderr.splitlines()[-1]
