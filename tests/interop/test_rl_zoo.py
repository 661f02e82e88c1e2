"""The scripts of rl-zoo3 run on kinarm's ids as they are, with the hyperparameters that ship."""

import os
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip("rl_zoo3")

from kinarm.policies import zoo_hyperparameters

pytestmark = pytest.mark.slow

FLAT, GOALS = "kinarm/ReachRight-v0", "kinarm/ReachGoalRight-v0"
SMALL = {
    "ppo": ["n_envs:4", "batch_size:64"],
    "a2c": ["n_envs:4"],
    "sac": ["learning_starts:560", "gradient_steps:1"],
    "td3": ["learning_starts:560", "gradient_steps:1"],
    "tqc": ["learning_starts:560", "gradient_steps:1"],
}
"""What makes the trainings short."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder to work in, with the file by which rl-zoo3 learns of other environments."""
    path = tmp_path_factory.mktemp("zoo")
    (path / "custom_envs.py").write_text("import kinarm\n")
    return path


def zoo(folder, script, *arguments):
    """Run a script of rl-zoo3 in a process of its own; returns what it printed."""
    done = subprocess.run(
        [sys.executable, "-m", f"rl_zoo3.{script}", *map(str, arguments)],
        cwd=folder,
        env={**os.environ, "MPLBACKEND": "Agg", "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def train(folder, algorithm, env_id, *others):
    settings = ["--conf-file", zoo_hyperparameters(algorithm), "-params", *SMALL[algorithm]]
    budget = ["-n", 800, "--eval-freq", 400, "--eval-episodes", 4]
    return zoo(folder, "train", "--algo", algorithm, "--env", env_id, *settings, *budget, *others)


@pytest.fixture(scope="module")
def trained(folder):
    """The logs of a training with PPO."""
    printed = train(folder, "ppo", FLAT)
    assert "Success rate" in printed
    return folder / "logs" / "ppo" / "kinarm-ReachRight-v0_1"


def test_train(trained):
    assert (trained / "kinarm-ReachRight-v0.zip").exists()
    assert (trained / "kinarm-ReachRight-v0" / "vecnormalize.pkl").exists()
    log = np.load(trained / "evaluations.npz")
    assert log["results"].shape == log["successes"].shape == (2, 4)


@pytest.mark.parametrize(
    ("algorithm", "env_id"),
    [("a2c", FLAT), ("td3", FLAT), ("sac", GOALS), ("tqc", GOALS)],
)
def test_train_with_other_algorithms(folder, algorithm, env_id):
    assert "Success rate" in train(folder, algorithm, env_id)
    name = env_id.replace("/", "-")
    assert list((folder / "logs" / algorithm).glob(f"{name}_*/{name}.zip"))


def test_packages_can_be_named_instead(tmp_path):
    assert train(tmp_path, "ppo", FLAT, "--gym-packages", "kinarm")


def test_enjoy_evaluates(folder, trained):
    printed = zoo(
        folder, "enjoy", "--algo", "ppo", "--env", FLAT, "-f", "logs", "--no-render", "-n", 200
    )
    assert "Success rate" in printed
    assert "Mean reward" in printed


def test_record_video(folder, trained):
    pytest.importorskip("moviepy")
    size = ["--env-kwargs", "width:64", "height:48"]
    zoo(folder, "record_video", "--algo", "ppo", "--env", FLAT, "-f", "logs", "-n", 20, *size)
    (film,) = (trained / "videos").glob("*.mp4")
    assert film.stat().st_size > 500


def test_plot_train(folder, trained):
    pytest.importorskip("seaborn")
    names = ["-a", "ppo", "-e", "kinarm-ReachRight-v0", "-f", "logs", "-y", "success", "-w", 2]
    assert "No data available" not in zoo(folder, "cli", "plot_train", *names)


def test_all_plots_tabulates(folder, trained):
    pytest.importorskip("seaborn")
    names = ["-a", "ppo", "-e", "kinarm-ReachRight-v0", "-f", "logs", "-k", "successes"]
    printed = zoo(folder, "cli", "all_plots", *names, "--no-display")
    assert "kinarm-ReachRight-v0" in printed
