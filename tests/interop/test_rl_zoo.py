"""The scripts of rl-zoo3 run on the ids as they are: what the page shows, shortened."""

import os
import re
import shlex
import subprocess
import sys

import numpy as np
import pytest
from pages import DOCS, ROOT, named_blocks

pytest.importorskip("rl_zoo3")

pytestmark = pytest.mark.slow

PAGE = (DOCS / "how-to" / "stable_baselines3.md").read_text(encoding="utf-8")
BLOCKS = named_blocks(DOCS / "how-to" / "stable_baselines3.md")
FLAT, GOALS = "kinarm/ReachRight-v0", "kinarm/ReachGoalRight-v0"
SMALL = {
    "ppo": ["n_envs:4", "batch_size:64"],
    "a2c": ["n_envs:4"],
    "sac": ["learning_starts:560", "gradient_steps:1"],
    "td3": ["learning_starts:560", "gradient_steps:1"],
    "tqc": ["learning_starts:560", "gradient_steps:1"],
}
"""What makes the trainings short."""

ENDED = "a training has ended"
SEVERAL = f"""
import runpy, sys
for words in {{}}:
    sys.argv = ["train", *words]
    runpy.run_module("rl_zoo3.train", run_name="__main__")
    print({ENDED!r}, flush=True)
"""


def run(line, folder, *others):
    """Run a command line in a process of its own, with further arguments; returns its output."""
    program, *words = shlex.split(line)
    if program == "kinarm-eval":
        words = ["-m", "kinarm", "eval", *words]
    done = subprocess.run(
        [sys.executable, *words, *map(str, others)],
        cwd=folder,
        env={**os.environ, "MPLBACKEND": "Agg", "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def training(algorithm, env_id):
    """Train as the page does, with another algorithm on another environment, for a moment."""
    line = BLOCKS["zoo-train"].replace("data/zoo/ppo", str(ROOT / "data" / "zoo" / algorithm))
    line = line.replace("--algo ppo", f"--algo {algorithm}").replace(FLAT, env_id).strip()
    budget = "-n 800 --eval-freq 400 --eval-episodes 4"
    return f"{line} -params {' '.join(SMALL[algorithm])} {budget}"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder to work in, with the file by which rl-zoo3 learns of other environments."""
    path = tmp_path_factory.mktemp("zoo")
    content, name = re.search(r'^echo "(.*)" > (\S+)$', PAGE, re.MULTILINE).groups()
    (path / name).write_text(f"{content}\n")
    return path


@pytest.fixture(scope="module")
def trained(folder):
    """The logs of a training with PPO."""
    assert "Success rate" in run(training("ppo", FLAT), folder)
    return folder / "logs" / "ppo" / "kinarm-ReachRight-v0_1"


def test_train(trained):
    assert (trained / "kinarm-ReachRight-v0.zip").exists()
    assert (trained / "kinarm-ReachRight-v0" / "vecnormalize.pkl").exists()
    log = np.load(trained / "evaluations.npz")
    assert log["results"].shape == log["successes"].shape == (2, 4)


@pytest.mark.rare
def test_train_with_other_algorithms(folder):
    """One after the other in one process, as each would be in its own."""
    others = {"td3": FLAT, "sac": GOALS, "tqc": GOALS}
    words = [shlex.split(training(*other))[3:] for other in others.items()]
    (folder / "several.py").write_text(SEVERAL.format(words))
    printed = run("python several.py", folder).split(ENDED)[:-1]
    assert ["Success rate" in each for each in printed] == [True] * len(others)
    for algorithm, env_id in others.items():
        name = env_id.replace("/", "-")
        assert list((folder / "logs" / algorithm).glob(f"{name}_*/{name}.zip"))


def test_enjoy_evaluates(folder, trained):
    printed = run(BLOCKS["zoo-enjoy"], folder, "-n", 200)
    assert "Success rate" in printed
    assert "Mean reward" in printed


@pytest.mark.rare
def test_record_video(folder, trained):
    pytest.importorskip("moviepy")
    small = ["-n", 20, "--env-kwargs", "width:64", "height:48"]
    run(BLOCKS["zoo-film"], folder, *small)
    (film,) = (trained / "videos").glob("*.mp4")
    assert film.stat().st_size > 500


@pytest.mark.rare
def test_plots(folder, trained):
    pytest.importorskip("seaborn")
    curve, table = BLOCKS["zoo-plot"].strip().splitlines()
    assert "No data available" not in run(curve, folder, "-w", 2)
    assert "kinarm-ReachRight-v0" in run(table, folder)


def test_kinarm_evaluates_the_model(folder, trained):
    assert "kinarm-ReachRight-v0" in run(BLOCKS["zoo-judge"], folder, "--trials", 10)
