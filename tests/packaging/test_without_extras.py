"""The tests pass where the extra ``test`` alone is installed, as ``make test`` in a new clone."""

import os
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import distribution, distributions, packages_distributions
from itertools import chain
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
CHEAP = ("campaign/test_loaders.py", "interop", "kinarm/test_streams.py")
"""What runs: folders and files that use libraries of the extras, and take seconds without."""

HIDE = """
import sys
from importlib.machinery import PathFinder

class WithoutExtras(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        return None if name in {modules} else super().find_spec(name, path, target)

    @classmethod
    def find_distributions(cls, *context):
        found = super().find_distributions(*context)
        return (each for each in found if each.name not in {distributions})

sys.meta_path[sys.meta_path.index(PathFinder)] = WithoutExtras
"""


def stated(name: str, extras: set[str]) -> list[str]:
    """What a distribution says that it needs; of kinarm, what stands in ``pyproject.toml``."""
    if name != "kinarm":
        return distribution(name).requires or []
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    of_extras = (project["optional-dependencies"][extra] for extra in extras)
    return [*project["dependencies"], *chain.from_iterable(of_extras)]


def required(name: str, extras: set[str], seen: set[str]) -> Iterator[str]:
    """Distributions that one of them brings along."""
    for line in stated(name, extras):
        needed = Requirement(line)
        markers = [{"extra": extra} for extra in extras or {""}]
        if needed.marker is None or any(needed.marker.evaluate(each) for each in markers):
            spelled = f"{canonicalize_name(needed.name)}[{','.join(sorted(needed.extras))}]"
            if spelled not in seen:
                seen.add(spelled)
                yield canonicalize_name(needed.name)
                yield from required(needed.name, needed.extras, seen)


def brought_by_extras() -> dict[str, list[str]]:
    """Modules and distributions that would not be here with the extra ``test`` alone."""
    here = {"kinarm", "pip", *required("kinarm", {"test"}, set())}
    modules = [
        module
        for module, owners in packages_distributions().items()
        if here.isdisjoint(map(canonicalize_name, owners))
    ]
    names = [each.name for each in distributions()]
    return {
        "modules": modules,
        "distributions": [name for name in names if canonicalize_name(name) not in here],
    }


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Variables with which Python, and what it starts, finds no module of the extras."""
    hidden = brought_by_extras()
    if "torch" not in hidden["modules"]:
        pytest.skip("there are no extras to do without")
    folder = tmp_path_factory.mktemp("hidden")
    (folder / "sitecustomize.py").write_text(HIDE.format(**hidden))
    return {**os.environ, "PYTHONPATH": str(folder), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}


def run_pytest(environment: dict[str, str], *arguments: str) -> None:
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-5000:] + done.stderr


def test_what_is_hidden_is_not_there(environment):
    code = "from importlib.util import find_spec; print(find_spec('torch'), find_spec('numba'))"
    command = [sys.executable, "-c", code]
    said = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    torch, numba = said.stdout.split(maxsplit=1)
    assert torch == "None"
    assert numba.startswith("ModuleSpec")


def test_every_test_is_found(environment):
    run_pytest(environment, "--collect-only", "tests")


def test_what_needs_an_extra_is_skipped(environment):
    run_pytest(environment, "-m", "not slow", *(f"tests/{name}" for name in CHEAP))
