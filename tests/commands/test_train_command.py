"""``kinarm-train``: what it writes, and that an interrupted training loses nothing."""

import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from equal_policies import check_equal
from refusals import check_refused

from kinarm.policies import Policy, recipe, train_policy
from kinarm.policies.checkpoint import load_checkpoint, save_checkpoint
from kinarm.problem import PROBLEMS
from kinarm.task import RewardWeights

ROOT = Path(__file__).resolve().parents[2]
LONG = {"iterations": 1000, "directions": 2, "top_directions": 2}
LONG_OPTIONS = ["--iterations", "1000", "--directions", "2", "--top-directions", "2"]
TRAIN_WITH_FREQUENT_CHECKPOINTS = """
import signal, sys
from kinarm.evaluation.commands import train
from kinarm.policies import training
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job may inherit "ignore"
training.CHECKPOINT_SECONDS = 0.1
train.main(sys.argv[1:])
"""


def read_curve(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def stop_after(iteration: int, config, path: Path) -> None:
    """Leave the checkpoint of a training that was stopped after some iterations."""
    states = []
    train_policy(config, on_iteration=states.append)
    save_checkpoint(path, config, states[iteration - 1])


def test_policy_and_curve_are_those_of_the_library(run, tmp_path):
    out = tmp_path / "p.npz"
    answer = run(
        *("kinarm-train", "ars", "--task", "left", "--seed", 3, "--iterations", 6, "--out", out)
    )
    assert answer.status == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["p.curve.csv", "p.npz"]
    expected = train_policy(recipe("ars", "paper", problem="left", seed=3, iterations=6))
    check_equal(Policy.load(out), expected.policy)
    rows = read_curve(tmp_path / "p.curve.csv")
    assert [int(row["iteration"]) for row in rows] == [1, 2, 3, 4, 5, 6]
    for row, point in zip(rows, expected.curve, strict=True):
        assert float(row["mean_return"]) == point.mean_return
        assert float(row["std_return"]) == point.std_return
        assert float(row["success"]) == point.success
        assert int(row["environment_steps"]) == point.environment_steps
        assert float(row["wall_time"]) > 0


def test_every_setting_reaches_the_training(run, tmp_path):
    settings = {
        "seed": 7,
        "iterations": 2,
        "directions": 5,
        "top_directions": 3,
        "episodes": 2,
        "step_size": 0.03,
        "noise": 0.02,
        "sharing": "pair",
        "step_size_schedule": "linear",
    }
    options = [word for k, v in settings.items() for word in (f"--{k.replace('_', '-')}", v)]
    options += ["--task", "both", "--arm", "paper_flange", "--start-spread", 0.5]
    options += ["--reward-success", 0.25, "--reward-collision", -2, "--symmetric", "--normalize"]
    out = tmp_path / "p.npz"
    assert run("kinarm-train", "ars", "--recipe", "brs", *options, "--out", out).status == 0
    made = Policy.load(out).provenance
    assert {name: made.config[name] for name in settings} == settings
    assert (made.recipe, made.seed) == ("brs*", 7)
    assert made.problem == PROBLEMS["both"].replace(arm="paper_flange", start_spread=0.5).pinned
    given = RewardWeights(**made.config["reward"])
    assert given == RewardWeights(success=0.25, collision=-2.0)
    assert (made.config["normalize"], made.config["scale_by_deviation"]) == (True, False)
    assert made.config["symmetric"]


SYMMETRIC = ("ars", "--symmetric", "--iterations", 1)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (
            (*SYMMETRIC, "--scene", "desk"),
            "symmetric has no effect: obstacles are not their own mirror image",
        ),
        (SYMMETRIC, ""),
        (("ars", "--recipe", "tuned", "--iterations", 1), ""),
    ],
)
def test_a_setting_without_effect_is_told(run, tmp_path, options, line):
    answer = run("kinarm-train", *options, "--out", tmp_path / "p.npz")
    assert answer.status == 0
    told = [each for each in answer.err.splitlines() if "symmetric" in each]
    assert told == ([line] if line else [])


def test_a_recipe_and_a_problem_from_files(run, tmp_path):
    PROBLEMS["left"].replace(tolerance=0.1, name="near").save(tmp_path / "near.toml")
    (tmp_path / "mine.toml").write_text("iterations = 3\n")
    out = tmp_path / "p.npz"
    files = ("--recipe", tmp_path / "mine.toml", "--problem", tmp_path / "near.toml")
    arguments = ("--seed", 5, "--horizon", 9, "--out", out)
    assert run("kinarm-train", "ars", *files, *arguments).status == 0
    made = Policy.load(out).provenance
    assert (made.recipe, made.seed, made.config["iterations"]) == ("mine", 5, 3)
    assert made.problem == PROBLEMS["left"].replace(name="near", tolerance=0.1, horizon=9).pinned


def test_what_is_there_is_replaced_on_demand_alone(run, tmp_path):
    """A policy, and the checkpoint of a training that goes on."""
    out, checkpoint = tmp_path / "p.npz", tmp_path / "p.checkpoint.npz"
    arguments = ("kinarm-train", "ars", "--iterations", 2, "--seed", 1, "--out", out)
    stop_after(2, recipe("ars", "paper", iterations=4), checkpoint)
    before = checkpoint.read_bytes()
    check_refused(run(*arguments), "--resume")
    checkpoint.rename(out)
    check_refused(run(*arguments), "--overwrite")
    assert [(path, path.read_bytes()) for path in tmp_path.iterdir()] == [(out, before)]
    assert run(*arguments, "--overwrite").status == 0
    assert Policy.load(out).provenance.seed == 1


@pytest.mark.parametrize(
    ("option", "told"),
    [
        ("--arm paper_flange", "arm"),
        ("--seed 1 --noise 0.5", "with another noise and seed: leave out"),
    ],
)
def test_other_settings_are_refused_when_resuming(run, tmp_path, option, told):
    """A setting that would be ignored is an error, and the checkpoint stays as it is."""
    checkpoint = tmp_path / "p.checkpoint.npz"
    stop_after(2, recipe("ars", "paper", iterations=4), checkpoint)
    before = checkpoint.read_bytes()
    words = ("--out", tmp_path / "p.npz", "--resume", *option.split())
    answer = run("kinarm-train", "ars", *words)
    assert (answer.status, answer.out) == (2, "")
    assert len(answer.err.splitlines()) == 1
    assert told in answer.err
    if "leave out" in told:
        assert f"delete {str(checkpoint)!r} to train anew" in answer.err
    assert checkpoint.read_bytes() == before
    assert not (tmp_path / "p.npz").exists()


def interrupt(process: subprocess.Popen, checkpoint: Path) -> str:
    """Send Ctrl-C once a training has got somewhere; return what it says on standard error."""
    while not (checkpoint.exists() and load_checkpoint(checkpoint)[1].iteration >= 100):
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    return process.communicate(timeout=60)[1]


def test_ctrl_c_and_resume_give_the_uninterrupted_policy(run, tmp_path):
    out, checkpoint = tmp_path / "p.npz", tmp_path / "p.checkpoint.npz"
    process = subprocess.Popen(
        [
            *(sys.executable, "-c", TRAIN_WITH_FREQUENT_CHECKPOINTS, "ars", "--out", str(out)),
            *LONG_OPTIONS,
        ],
        cwd=ROOT,
        env={**os.environ, "COLUMNS": "100"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    errors = interrupt(process, checkpoint)
    assert process.returncode == 130
    assert "Traceback" not in errors
    assert errors.splitlines()[-1].startswith("kinarm-train: interrupted")
    _, state = load_checkpoint(checkpoint)
    assert 100 <= state.iteration < LONG["iterations"]
    assert not out.exists()

    assert run("kinarm-train", "ars", "--out", out, "--resume").status == 0
    assert not checkpoint.exists()
    check_equal(Policy.load(out), train_policy(recipe("ars", "paper", **LONG)).policy)
