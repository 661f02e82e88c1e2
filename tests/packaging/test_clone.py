"""Sub-packages can be imported at the root of a clone and elsewhere, installed or not."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("kinarm.policies", "kinarm.evaluation", "kinarm.data")
SHOW = "import importlib, sys; print(importlib.import_module(sys.argv[1]).__file__)"


def where(package: str, folder: Path, **variables: str) -> Path:
    """Import a package in a new process and return the folder that it comes from."""
    done = subprocess.run(
        [sys.executable, "-c", SHOW, package],
        cwd=folder,
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return Path(done.stdout.strip()).resolve().parent


@pytest.mark.parametrize("package", PACKAGES)
def test_at_the_root(package):
    assert where(package, ROOT) == ROOT / package.removeprefix("kinarm.")


@pytest.mark.parametrize("package", PACKAGES)
def test_elsewhere(package, tmp_path):
    assert where(package, tmp_path).name == package.removeprefix("kinarm.")


@pytest.mark.parametrize("package", PACKAGES)
def test_on_the_path_without_installation(package, tmp_path):
    found = where(package, tmp_path, PYTHONPATH=str(ROOT))
    assert found == ROOT / package.removeprefix("kinarm.")


def test_a_folder_called_kinarm_elsewhere_gains_no_path(tmp_path):
    """The guard is for clones: a copy without a pyproject.toml beside it stays as it is."""
    copy = tmp_path / "kinarm"
    (copy / "envs").mkdir(parents=True)
    modules = ("__init__.py", "__init__.pyi")
    for name in (
        *modules,
        "_interrupts.py",
        *(f"envs/{each}" for each in (*modules, "registration.py")),
    ):
        (copy / name).write_bytes((ROOT / "kinarm" / name).read_bytes())
    code = "import kinarm; print(list(kinarm.__path__))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == str([str(copy)])
