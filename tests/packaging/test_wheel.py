"""The wheel holds all that is needed, and works away from the clone."""

import json
import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pytest

from kinarm import Arm, arm_names
from kinarm.policies import policy_names
from kinarm.simulator import Simulator

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check")

USE_IT = """
import json, pathlib, sys
import numpy as np
import kinarm, kinarm.data, kinarm.evaluation, kinarm.policies
from kinarm import Arm, Simulator, arm_names
from kinarm.policies import policy_names
simulator = Simulator("both", threads=1)
starts, goals = simulator.sample(np.random.default_rng(0), 3)
rollouts = simulator.rollout_actions(np.ones((3, 64, 5)), starts, goals)
json.dump({
    "files": [m.__file__ for m in (kinarm, kinarm.data, kinarm.evaluation, kinarm.policies)],
    "path": list(kinarm.__path__),
    "arms": list(arm_names()),
    "digest": Arm.load("paper").digest,
    "policies": list(policy_names()),
    "distance": rollouts.distance.tolist(),
}, sys.stdout)
"""


def call(*arguments: object, **settings: object) -> str:
    words = [str(argument) for argument in arguments]
    done = subprocess.run(words, capture_output=True, text=True, check=False, **settings)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def sources() -> list[str]:
    """Files of the project: what is recorded, and what is new and not ignored."""
    names = call("git", "ls-files", "-co", "--exclude-standard", cwd=ROOT).splitlines()
    return [name for name in names if (ROOT / name).is_file()]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build a wheel without network, from a copy, so that the clone stays as it is."""
    copy, out = (tmp_path_factory.mktemp(name) for name in ("copy", "wheel"))
    for name in sources():
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, copy / name)
    build = ("wheel", copy, "--no-deps", "--no-build-isolation", "--no-index", "-w", out)
    call(*PIP, *build, cwd=out)
    (path,) = out.iterdir()
    return path


@pytest.fixture(scope="module")
def target(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install the wheel into a folder of its own, beside what the clone has compiled."""
    folder = tmp_path_factory.mktemp("target")
    options = ("--no-deps", "--no-index", "--no-compile", "--target")
    call(*PIP, "install", *options, folder, wheel, cwd=folder)
    for source, place in (("kinarm", "kinarm"), ("policies", "kinarm/policies")):
        for file in (ROOT / source).rglob("*.nb[ci]"):
            copied = folder / place / file.relative_to(ROOT / source)
            copied.parent.mkdir(exist_ok=True)
            shutil.copyfile(file, copied)
    return folder


def environment(target: Path) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(target)}


def test_modules_and_data_are_in_the_wheel_and_nothing_else(wheel):
    folders = {"kinarm": "kinarm", **{n: f"kinarm/{n}" for n in ("policies", "evaluation", "data")}}
    expected = {
        "/".join([folders[name.split("/")[0]], *name.split("/")[1:]])
        for name in sources()
        if name.split("/")[0] in folders
        and not name.startswith(("data/results/", "data/leaderboard/"))
    }
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
    assert {"kinarm/py.typed", "kinarm/policies/py.typed", "kinarm/evaluation/py.typed"} <= names
    assert names == expected


def test_metadata_name_the_commands_the_licence_and_no_torch(wheel):
    with zipfile.ZipFile(wheel) as archive:
        info = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        folder = info.removesuffix("METADATA")
        metadata = archive.read(info).decode()
        commands = archive.read(f"{folder}entry_points.txt").decode()
        assert f"{folder}licenses/LICENSE" in archive.namelist()
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    assert all(f"{name} = {place}" in commands for name, place in scripts.items())
    assert "License-Expression: BSD-2-Clause" in metadata
    required = [line for line in metadata.splitlines() if line.startswith("Requires-Dist")]
    core = [line for line in required if "extra ==" not in line]
    assert any("numba" in line for line in core)
    assert not any("torch" in line or "stable" in line for line in core)


def test_it_works_from_where_it_was_installed_as_the_clone_does(target, tmp_path):
    used = json.loads(call(sys.executable, "-c", USE_IT, cwd=tmp_path, env=environment(target)))
    assert all(Path(file).is_relative_to(target) for file in used["files"])
    assert used["path"] == [str(target / "kinarm")]
    assert used["arms"] == list(arm_names())
    assert used["digest"] == Arm.load("paper").digest
    assert used["policies"] == list(policy_names())
    simulator = Simulator("both")
    starts, goals = simulator.sample(np.random.default_rng(0), 3)
    rollouts = simulator.rollout_actions(np.ones((3, 64, 5)), starts, goals)
    assert used["distance"] == rollouts.distance.tolist()


def test_commands_work_from_elsewhere(target, tmp_path):
    options = ("--policy", "zero", "--problem", "left", "--trials", "2", "--out", "results")
    command = (sys.executable, "-m", "kinarm", "eval", *options)
    call(*command, cwd=tmp_path, env=environment(target))
    assert (tmp_path / "results" / "evaluation.json").is_file()


def test_the_root_of_a_clone_uses_the_clone_beside_an_installed_wheel(target):
    code = "import kinarm.policies, kinarm.evaluation; print(kinarm.policies.__file__)"
    out = call(sys.executable, "-c", code, cwd=ROOT, env=environment(target))
    assert Path(out.strip()) == ROOT / "policies" / "__init__.py"
