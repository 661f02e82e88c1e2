"""``kinarm-train ppo``: what it writes, resuming, and what it says without its packages."""

import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("stable_baselines3")

from kinarm.evaluation.evaluation import evaluate
from kinarm.policies import (
    Policy,
    load_checkpoint,
    recipe,
    save_checkpoint,
    train_policy,
)
from kinarm.problem import PROBLEMS

ROOT = Path(__file__).resolve().parents[2]
TINY = {"n_envs": 4, "n_steps": 16, "batch_size": 32, "n_epochs": 2, "net_arch": (8, 8)}
TINY_OPTIONS = (
    *("--n-envs", 4, "--n-steps", 16, "--batch-size", 32, "--n-epochs", 2),
    *("--net-arch", 8, 8),
)
TRAIN_WITH_FREQUENT_CHECKPOINTS = """
import signal, sys
from kinarm.policies import train, training_files
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job may inherit "ignore"
training_files.CHECKPOINT_SECONDS = 0.1
train.main(sys.argv[1:])
"""


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


def test_every_setting_reaches_the_training(run, tmp_path):
    settings = {
        "seed": 7,
        "iterations": 2,
        "n_envs": 6,
        "n_steps": 10,
        "batch_size": 30,
        "n_epochs": 3,
        "learning_rate": 0.002,
        "gamma": 0.9,
        "ent_coef": 0.01,
        "training_tolerance": 0.04,
        "learning_rate_schedule": "constant",
    }
    options = [word for k, v in settings.items() for word in (f"--{k.replace('_', '-')}", v)]
    out = tmp_path / "p.npz"
    arguments = ("--recipe", "tuned", "--net-arch", 7, 6, "--no-symmetric", *options)
    arguments += ("--task", "both", "--arm", "paper_flange", "--reward-step", -0.01)
    assert run("kinarm-train", "ppo", *arguments, "--out", out).status == 0
    made = Policy.load(out).provenance
    assert {name: made.config[name] for name in settings} == settings
    assert (made.config["net_arch"], made.config["symmetric"]) == ([7, 6], False)
    assert (made.algorithm, made.recipe) == ("ppo", "tuned*")
    assert made.problem == PROBLEMS["both"].replace(arm="paper_flange").pinned
    assert (made.config["reward"]["step"], made.config["reward"]["success"]) == (-0.01, 5.0)
    assert (made.seed, made.environment_steps) == (7, 120)


def test_a_trained_policy_can_be_evaluated(run, tmp_path):
    out = tmp_path / "p.npz"
    arguments = ("--recipe", "tuned", "--task", "both", "--iterations", 2, *TINY_OPTIONS)
    assert run("kinarm-train", "ppo", *arguments, "--out", out).status == 0
    evaluation = evaluate(out, trials=3)
    assert (evaluation.problem.name, len(evaluation.rollouts)) == ("both", 3)
    assert evaluation.contestant.algorithm == "ppo"


@pytest.mark.parametrize("name", ["paper", "tuned"])
def test_resumed_is_uninterrupted(run, tmp_path, name):
    config = recipe("ppo", name, iterations=5, **TINY)
    out = tmp_path / "p.npz"
    leave_checkpoint(tmp_path / "p.checkpoint.npz", config)
    answer = run("kinarm-train", "ppo", "--out", out, "--resume", "--recipe", name, "--seed", 0)
    assert answer.status == 0, answer.err
    check_equal(Policy.load(out), train_policy(config).policy)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["p.curve.csv", "p.npz"]


@pytest.mark.parametrize(
    "change", [("--task", "left"), ("--gamma", 0.5), ("--net-arch", 9, 9), ("--recipe", "tuned")]
)
def test_other_settings_are_refused_when_resuming(run, tmp_path, change):
    checkpoint = tmp_path / "p.checkpoint.npz"
    leave_checkpoint(checkpoint, recipe("ppo", "paper", iterations=3, **TINY))
    before = checkpoint.read_bytes()
    answer = run("kinarm-train", "ppo", "--out", tmp_path / "p.npz", "--resume", *change)
    assert (answer.status, answer.out, len(answer.err.splitlines())) == (2, "", 1)
    assert {"--task": "goal_regions"}.get(change[0], change[0][2:].replace("-", "_")) in answer.err
    assert checkpoint.read_bytes() == before


def test_learners_do_not_resume_each_other(run, tmp_path):
    leave_checkpoint(tmp_path / "p.checkpoint.npz", recipe("ppo", "paper", iterations=3, **TINY))
    answer = run("kinarm-train", "ars", "--out", tmp_path / "p.npz", "--resume")
    assert (answer.status, answer.out, len(answer.err.splitlines())) == (2, "", 1)
    assert "is of the learner ppo" in answer.err


def test_ctrl_c_and_resume_give_the_uninterrupted_policy(run, tmp_path):
    out, checkpoint = tmp_path / "p.npz", tmp_path / "p.checkpoint.npz"
    options = [str(word) for word in ("--iterations", 150, *TINY_OPTIONS)]
    process = subprocess.Popen(
        [sys.executable, "-c", TRAIN_WITH_FREQUENT_CHECKPOINTS, "ppo", "--out", out, *options],
        cwd=ROOT,
        env={**os.environ, "COLUMNS": "100"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    while not (checkpoint.exists() and load_checkpoint(checkpoint)[1].iteration >= 10):
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    errors = process.communicate(timeout=60)[1]
    assert process.returncode == 130
    assert "Traceback" not in errors
    assert errors.splitlines()[-1].startswith("kinarm-train: interrupted after")
    assert not out.exists()
    assert run("kinarm-train", "ppo", "--out", out, "--resume").status == 0
    check_equal(
        Policy.load(out), train_policy(recipe("ppo", "paper", iterations=150, **TINY)).policy
    )


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


def test_progress_is_shown(run, tmp_path, monkeypatch):
    monkeypatch.setattr("kinarm._console.LINE_SECONDS", -1.0)
    answer = run(
        "kinarm-train", "ppo", "--iterations", 3, *TINY_OPTIONS, "--out", tmp_path / "p.npz"
    )
    assert "ppo paper* right seed 0: 3/3 iterations" in answer.err


def test_without_its_packages_one_line_says_what_to_install(tmp_path):
    code = "import sys; sys.modules['stable_baselines3'] = None\n"
    code += "from kinarm.policies.train import main; main(sys.argv[1:])"
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
