"""Kernels are found in Numba's cache if nothing has changed, and work whatever happens to it."""

import os
import shutil
import subprocess
import sys

import pytest

SCRIPT = """
import resource, sys
if "full" in sys.argv:
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
from arm.kernels.outer import value
print(value(1.0), value.stats.cache_hits.total())
"""

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
    "kernels/stages.py": """
from numba import njit, types
from kinarm.kernels.compiling import Stage, call_stage

def stage(factor):
    def times(number):
        return factor * number

    return Stage(times, key=str(factor))

@njit
def call(address, number):
    return call_stage(address, (number,))
""",
    "kernels/other.py": "",
    "kernels/__init__.py": "",
    "__init__.py": "",
}


@pytest.fixture
def package(tmp_path):
    """A package of kernels."""
    for name, text in SOURCES.items():
        (tmp_path / "arm" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "arm" / name).write_text(text)
    return tmp_path / "arm"


@pytest.fixture
def value_of_one(package):
    """Call the kernel in another process: its value for 1, and whether it was in the cache."""
    folders = {"NUMBA_CACHE_DIR": package.parent / "cache", "PYTHONPATH": package.parent}

    def call(*arguments, **moved):
        variables = {name: str(folder) for name, folder in (folders | moved).items()}
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT, *arguments],
            env={**os.environ, **variables},
            capture_output=True,
            text=True,
            check=False,
        )
        assert (done.returncode, done.stderr) == (0, "")
        number, hits = done.stdout.split()
        return float(number), hits == "1"

    return call


@pytest.mark.rare
def test_whatever_happens_to_the_files_kernels_work(package, value_of_one):
    """A full disk leaves none; what is cut off is made anew."""
    anew, found = (40.0, False), (40.0, True)
    assert [value_of_one("full"), value_of_one()] == [anew, anew]

    damaged = list((package.parent / "cache").rglob("*.nb[ic]"))
    assert damaged
    for each in damaged:
        each.write_bytes(each.read_bytes()[:-7])
    assert [value_of_one(), value_of_one()] == [anew, found]


@pytest.mark.rare
def test_machine_code_is_as_fresh_as_all_that_is_compiled_in(package, value_of_one):
    """Files are changed, one by one; nothing but what changes is compiled anew."""

    def change(file, old, new):
        path = package / file
        path.write_text(path.read_text().replace(old, new) if old else new)
        return value_of_one()

    assert value_of_one() == (40.0, False)
    assert change("kernels/other.py", "", "UNUSED = 1\n") == (40.0, True)
    assert change("kernels/inner.py", "1.0", "2.0") == (60.0, False)
    assert change("constants.py", "2.0", "3.0") == (90.0, False)


def test_copies_of_the_sources_share_it(package, value_of_one):
    assert value_of_one() == (40.0, False)
    elsewhere = package.parent / "elsewhere"
    shutil.copytree(package, elsewhere / "arm")
    assert value_of_one(PYTHONPATH=elsewhere) == (40.0, True)


def test_stages_of_one_definition_are_kept_apart(package):
    """On disk, where processes put one each, and in memory, wherever they come from."""
    folders = {"NUMBA_CACHE_DIR": str(package.parent / "cache"), "PYTHONPATH": str(package.parent)}
    for numbers, expected in (("2,", ["14"]), ("3,", ["21"]), ("2, 3", ["14", "21"])):
        script = (
            "from arm.kernels.stages import *\n"
            f"stages = [stage(number) for number in ({numbers})]\n"
            "for each in stages:\n"
            "    each.address(types.int64)\n"
            "    each._addresses.clear()  # to be found by name again\n"
            "print(*(call(each.address(types.int64), 7) for each in stages))"
        )
        run = [sys.executable, "-c", script]
        assert subprocess.check_output(run, env=os.environ | folders, text=True).split() == expected
    assert len(list((package.parent / "cache").rglob("*.nbc"))) == 2


def test_links_to_the_sources_share_it(package, value_of_one):
    """As the modules of an editable install are."""
    linked = package.parent / "linked" / "arm"
    for name in SOURCES:
        (linked / name).parent.mkdir(parents=True, exist_ok=True)
        (linked / name).symlink_to(package / name)
    assert value_of_one(NUMBA_CACHE_DIR="", PYTHONPATH=linked.parent) == (40.0, False)
    assert value_of_one(NUMBA_CACHE_DIR="") == (40.0, True)


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
