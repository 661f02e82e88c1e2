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

from kinarm.evaluation.commands.train import TrainRequest
from kinarm.evaluation.experiments import runs
from kinarm.policies import Policy, load_checkpoint, recipe, train_policy
from kinarm.problem import PROBLEMS
from kinarm.task import RewardWeights

ROOT = Path(__file__).resolve().parents[2]
LONG = {"iterations": 1000, "directions": 2, "top_directions": 2}
LONG_OPTIONS = ["--iterations", "1000", "--directions", "2", "--top-directions", "2"]
TRAIN_WITH_FREQUENT_CHECKPOINTS = """
import signal, sys
from kinarm.evaluation.commands import train
from kinarm.evaluation.experiments import runs
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job may inherit "ignore"
runs.CHECKPOINT_SECONDS = 0.1
train.main(sys.argv[1:])
"""


def read_curve(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


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


def test_a_policy_is_replaced_on_demand_alone(run, tmp_path):
    out = tmp_path / "p.npz"
    out.write_bytes(b"something")
    arguments = ("kinarm-train", "ars", "--iterations", 2, "--seed", 1, "--out", out)
    check_refused(run(*arguments), "--overwrite")
    assert [(path, path.read_bytes()) for path in tmp_path.iterdir()] == [(out, b"something")]
    assert run(*arguments, "--overwrite").status == 0
    assert Policy.load(out).provenance.seed == 1


def test_what_is_interrupted_goes_on_with_the_same_settings_alone(run, tmp_path, monkeypatch):
    """A setting that would be ignored is an error, and the checkpoint stays as it is."""
    monkeypatch.setattr(runs, "CHECKPOINT_SECONDS", 0.0)
    save, saved = runs.save_checkpoint, []

    def interrupt(path, config, state, curve):
        save(path, config, state, curve)
        saved.append(state.iteration)
        if saved == [1, 2]:
            raise KeyboardInterrupt

    monkeypatch.setattr(runs, "save_checkpoint", interrupt)
    arguments = ("kinarm-train", "ars", "--iterations", 4, "--out", tmp_path / "p.npz")
    answer = run(*arguments)
    assert answer.status == 130
    assert answer.err.splitlines()[-1] == (
        "kinarm-train: interrupted; what is finished is kept, and the same command goes on"
    )
    before = contents(tmp_path)
    for change in ("--arm paper_flange", "--seed 1", "--noise 0.5", "--tolerance 0.1 --overwrite"):
        folder = str(tmp_path / "p.training")
        check_refused(
            run(*arguments, *change.split()), f"{folder!r} is of the experiment", "delete"
        )
        assert contents(tmp_path) == before
    answer = run(*arguments)
    assert answer.status == 0, answer.err
    assert saved == [1, 2, 3, 4]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["p.curve.csv", "p.npz"]
    check_equal(
        Policy.load(tmp_path / "p.npz"), train_policy(recipe("ars", "paper", iterations=4)).policy
    )


def test_what_fails_or_ends_before_a_checkpoint_leaves_nothing(run, tmp_path, monkeypatch):
    """Nothing of its own: other files stay."""
    policy, folder = tmp_path / "first.npz", tmp_path / "p.training"
    train_policy(recipe("ars", "paper", iterations=1)).policy.save(policy)
    folder.mkdir()
    (folder / "mine.txt").write_text("mine")
    before = contents(tmp_path)
    options = ("kinarm-train", "ppo", "--initial-policy", policy, "--out", tmp_path / "p.npz")
    check_refused(run(*options), "initial_policy")

    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(runs, "training_states", interrupt)
    assert run("kinarm-train", "ars", "--out", tmp_path / "p.npz").status == 130
    assert contents(tmp_path) == before


def test_a_request_gives_policy_and_curve(tmp_path):
    out = tmp_path / "p.npz"
    (trained,) = TrainRequest(learner="ars", settings={"iterations": 2}, out=out).run()
    expected = train_policy(recipe("ars", "paper", iterations=2))
    assert (trained.seed, trained.out) == (0, out)
    assert [point.mean_return for point in trained.curve] == [
        point.mean_return for point in expected.curve
    ]
    check_equal(trained.policy, expected.policy)


def interrupt(process: subprocess.Popen, folder: Path) -> str:
    """Send Ctrl-C once a training has got somewhere; return what it says on standard error."""
    while not any(load_checkpoint(path)[1].iteration >= 100 for path in folder.glob("*.npz")):
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    return process.communicate(timeout=60)[1]


def test_ctrl_c_and_the_same_command_give_the_uninterrupted_policy(run, tmp_path):
    out, checkpoints = tmp_path / "p.npz", tmp_path / "p.training" / "checkpoints"
    arguments = ("ars", "--out", str(out), *LONG_OPTIONS)
    process = subprocess.Popen(
        [sys.executable, "-c", TRAIN_WITH_FREQUENT_CHECKPOINTS, *arguments],
        cwd=ROOT,
        env={**os.environ, "COLUMNS": "100"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    errors = interrupt(process, checkpoints)
    assert process.returncode == 130
    assert "Traceback" not in errors
    assert errors.splitlines()[-1].startswith("kinarm-train: interrupted")
    (checkpoint,) = checkpoints.iterdir()
    assert 100 <= load_checkpoint(checkpoint)[1].iteration < LONG["iterations"]
    assert not out.exists()

    assert run("kinarm-train", *arguments).status == 0
    assert not checkpoints.exists()
    check_equal(Policy.load(out), train_policy(recipe("ars", "paper", **LONG)).policy)
