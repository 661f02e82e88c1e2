"""``kinarm-train ppo``: what it writes, resuming, and what it says without its packages."""

import csv
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("stable_baselines3")

from kinarm.policies import (
    Policy,
    recipe,
    save_checkpoint,
    train_policy,
)

ROOT = Path(__file__).resolve().parents[2]
TINY = {"n_envs": 4, "n_steps": 16, "batch_size": 32, "n_epochs": 2, "net_arch": (8, 8)}
TINY_OPTIONS = (
    *("--n-envs", 4, "--n-steps", 16, "--batch-size", 32, "--n-epochs", 2),
    *("--net-arch", 8, 8),
)


def check_equal(one: Policy, other: Policy) -> None:
    """Bit for bit."""
    for first, second in zip(one.layers, other.layers, strict=True):
        assert first.weights.tobytes() == second.weights.tobytes()
        assert first.bias.tobytes() == second.bias.tobytes()
    assert (one.mean.tobytes(), one.std.tobytes()) == (other.mean.tobytes(), other.std.tobytes())


def leave_checkpoint(path: Path, config) -> None:
    """Leave the checkpoint of a training that was stopped after two iterations."""
    states = []
    train_policy(config, on_iteration=states.append)
    save_checkpoint(path, config, states[1])


def test_policy_and_curve_are_those_of_the_library(run, tmp_path):
    out = tmp_path / "p.npz"
    arguments = ("--task", "both", "--seed", 3, "--iterations", 4, *TINY_OPTIONS)
    answer = run("kinarm-train", "ppo", *arguments, "--out", out)
    assert answer.status == 0, answer.err
    assert f"written: {out}, " in answer.out
    assert sorted(path.name for path in tmp_path.iterdir()) == ["p.curve.csv", "p.npz"]
    expected = train_policy(recipe("ppo", "paper", problem="both", seed=3, iterations=4, **TINY))
    check_equal(Policy.load(out), expected.policy)
    with (tmp_path / "p.curve.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["environment_steps"]) for row in rows] == [64, 128, 192, 256]
    assert [int(row["iteration"]) for row in rows] == [1, 2, 3, 4]


@pytest.mark.parametrize("name", ["paper", "tuned"])
def test_resumed_is_uninterrupted(run, tmp_path, name):
    config = recipe("ppo", name, iterations=5, **TINY)
    out = tmp_path / "p.npz"
    leave_checkpoint(tmp_path / "p.checkpoint.npz", config)
    answer = run("kinarm-train", "ppo", "--out", out, "--resume", "--recipe", name, "--seed", 0)
    assert answer.status == 0, answer.err
    check_equal(Policy.load(out), train_policy(config).policy)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["p.curve.csv", "p.npz"]


def test_learners_do_not_resume_each_other(run, tmp_path):
    leave_checkpoint(tmp_path / "p.checkpoint.npz", recipe("ppo", "paper", iterations=3, **TINY))
    answer = run("kinarm-train", "ars", "--out", tmp_path / "p.npz", "--resume")
    assert (answer.status, answer.out, len(answer.err.splitlines())) == (2, "", 1)
    assert "is of the learner ppo" in answer.err


@pytest.mark.parametrize(("rate", "words"), [("1e30", "at most 1e+06"), ("1e6", "diverged")])
def test_a_training_that_diverges_ends_in_one_line(run, tmp_path, rate, words):
    options = ("--learning-rate", rate, "--iterations", 20, "--out", tmp_path / "p.npz")
    answer = run("kinarm-train", "ppo", *TINY_OPTIONS, *options)
    assert answer.status == 2
    assert words in answer.err.splitlines()[-1]
    assert "Traceback" not in answer.err
    assert not (tmp_path / "p.npz").exists()


def test_tensorboard(run, tmp_path):
    pytest.importorskip("tensorboard")
    arguments = ("--iterations", 2, *TINY_OPTIONS, "--tensorboard", tmp_path / "a" / "logs")
    assert run("kinarm-train", "ppo", *arguments, "--out", tmp_path / "p.npz").status == 0
    assert list((tmp_path / "a" / "logs").glob("*tfevents*"))


def test_without_its_packages_one_line_says_what_to_install(tmp_path):
    code = "import sys; sys.modules['stable_baselines3'] = None\n"
    code += "from kinarm.evaluation.commands.train import main; main(sys.argv[1:])"
    done = subprocess.run(
        [sys.executable, "-c", code, "ppo", "--out", tmp_path / "p.npz"],
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "kinarm-train: stable_baselines3 is not installed: pip install 'kinarm[ppo]'\n"
    )
    assert list(tmp_path.iterdir()) == []
