"""``kinarm-train --seeds``: several seeds at once, which equal single trainings bit for bit."""

import re
from pathlib import Path

import pytest
from equal_policies import check_equal

from kinarm.errors import OutputError
from kinarm.evaluation.experiments import runs as experiments
from kinarm.policies import Policy, recipe, train_policy

SMALL = ("--directions", 2, "--top-directions", 2)
NAME = "ars-paper-right-seed{}"


def config(seed=0, **changes):
    settings = {"iterations": 9, "directions": 2, "top_directions": 2, **changes}
    return recipe("ars", "paper", problem="right", seed=seed, **settings)


@pytest.mark.parametrize("jobs", [1, 2])
def test_each_policy_is_that_of_a_single_training(run, tmp_path, jobs):
    folder = tmp_path / "right"
    arguments = ("ars", "--problem", "right", "--iterations", 9, *SMALL)
    answer = run("kinarm-train", *arguments, "--seeds", "3-5", "--jobs", jobs, "--out", folder)
    assert answer.status == 0, answer.err
    names = [NAME.format(seed) for seed in (3, 4, 5)]
    expected = [f"{name}{ending}" for name in names for ending in (".curve.csv", ".npz")]
    assert sorted(path.name for path in folder.glob("[!.]*")) == expected
    for seed, name in zip((3, 4, 5), names, strict=True):
        single = tmp_path / f"{seed}.npz"
        assert run("kinarm-train", *arguments, "--seed", seed, "--out", single).status == 0
        check_equal(Policy.load(folder / f"{name}.npz"), Policy.load(single))
    *lines, then = answer.out.splitlines()
    for seed, line in zip((3, 4, 5), lines, strict=True):
        assert re.match(rf"seed {seed}: [\d.]+ million steps in [\d.]+ s, return ", line)
        assert line.endswith(f"written: {folder / NAME.format(seed)}.npz")
    assert f"kinarm-eval {folder}/" in then


def test_the_same_command_finishes_each_seed_and_repeats_none(run, tmp_path, monkeypatch):
    """Seed 0 is finished, seed 1 was interrupted, seed 2 has not begun."""
    monkeypatch.setattr(experiments, "CHECKPOINT_SECONDS", 0.0)
    arguments = ("ars", "--problem", "right", "--iterations", 9, *SMALL, "--seeds", 3)
    options = ("--jobs", 1, "--out", tmp_path)
    save, resumed = experiments.save_checkpoint, []

    def interrupt(path, config, state, curve):
        save(path, config, state, curve)
        if isinstance(path, Path):
            resumed.append((config.seed, state.iteration))
        if resumed[-1] == (1, 4):
            raise KeyboardInterrupt

    monkeypatch.setattr(experiments, "save_checkpoint", interrupt)
    answer = run("kinarm-train", *arguments, *options)
    assert answer.status == 130
    assert answer.err.splitlines()[-1] == (
        "kinarm-train: interrupted; what is finished is kept, and the same command goes on"
    )
    before = (tmp_path / f"{NAME.format(0)}.npz").read_bytes()
    for change in (("--noise", 0.5), ("--tolerance", 0.1, "--overwrite")):
        answer = run("kinarm-train", *arguments, *options, *change)
        assert (answer.status, answer.err.count("\n")) == (2, 1)
        assert "is of the experiment 'ars-paper-right " in answer.err
    del resumed[:]
    answer = run("kinarm-train", *arguments, *options)
    assert answer.status == 0, answer.err
    assert resumed[0] == (1, 5)
    assert (tmp_path / f"{NAME.format(0)}.npz").read_bytes() == before
    assert "seed 0: finished earlier" in answer.out
    for seed in range(3):
        made = Policy.load(tmp_path / f"{NAME.format(seed)}.npz")
        check_equal(made, train_policy(config(seed)).policy)
    assert len(list(tmp_path.glob("[!.]*"))) == 6


def test_an_arm_that_changed_makes_other_trainings(run, tmp_path, shipped_arms):
    text = shipped_arms["paper"].description.path.read_text()
    arm, out = tmp_path / "own.urdf", tmp_path / "out"
    arguments = ("ars", "--arm", arm, "--iterations", 2, *SMALL, "--seeds", 1, "--out", out)
    arm.write_text(text)
    assert run("kinarm-train", *arguments).status == 0
    assert "finished earlier" in run("kinarm-train", *arguments).out
    arm.write_text(re.sub('lower="[^"]*"', 'lower="-2"', text, count=1))
    answer = run("kinarm-train", *arguments)
    assert (answer.status, answer.out) == (2, "")
    assert "is of the experiment 'ars-paper-right " in answer.err


def test_a_policy_that_was_not_written_is_made_again_and_more_seeds_are_trained(run, tmp_path):
    """A kill between training and policy leaves the training alone."""
    arguments = ("ars", "--problem", "right", "--iterations", 9, *SMALL, "--out", tmp_path)
    assert run("kinarm-train", *arguments, "--seeds", 1).status == 0
    first = tmp_path / f"{NAME.format(0)}.npz"
    before = first.read_bytes()
    first.unlink()
    assert run("kinarm-train", *arguments, "--seeds", 2, "--jobs", 1).status == 0
    assert first.read_bytes() == before
    check_equal(Policy.load(tmp_path / f"{NAME.format(1)}.npz"), train_policy(config(1)).policy)
    answer = run("kinarm-train", *arguments, "--seeds", 2)
    assert answer.out.count("finished earlier") == 2


def test_a_training_whose_policy_cannot_be_written_goes_on(run, tmp_path, monkeypatch):
    """From its last checkpoint, which only a written policy makes superfluous."""
    out = tmp_path / "a.npz"
    arguments = ("ars", "--problem", "right", "--iterations", 9, *SMALL, "--out", out)
    monkeypatch.setattr(experiments, "CHECKPOINT_SECONDS", 0.0)
    with monkeypatch.context() as patch:
        patch.setattr(Policy, "save", failing)
        assert run("kinarm-train", *arguments).status == 2
    assert len(list(tmp_path.rglob("checkpoints/*.npz"))) == 1
    answer = run("kinarm-train", *arguments)
    assert answer.status == 0, answer.err
    check_equal(Policy.load(out), train_policy(config(0)).policy)
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["a.curve.csv", "a.npz"]


def failing(*_, **__):
    raise OutputError("no space left")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--seeds", 2, "--seed", 1), "--seed and --seeds exclude each other"),
        (("--seeds", 0), "must be a number (5) or a rising range"),
        (("--seeds", "7-5"), "must be a number (5) or a rising range"),
        (("--seeds", "0-1000"), "must be a number (5) or a rising range"),
        (("--seeds", 2, "--out", "right.npz"), "with --seeds, --out is a folder: --out right"),
    ],
)
def test_bad_options_are_one_line_and_nothing_is_written(run, tmp_path, arguments, said):
    answer = run("kinarm-train", "ars", "--out", tmp_path / "out", *arguments)
    assert (answer.status, answer.out, answer.err.count("\n")) == (2, "", 1)
    assert said in answer.err
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_a_policy_in_the_way(run, tmp_path):
    train_policy(config(1, noise=0.5)).policy.save(tmp_path / f"{NAME.format(1)}.npz")
    arguments = ("ars", "--problem", "right", "--iterations", 9, *SMALL, "--seeds", 2)
    answer = run("kinarm-train", *arguments, "--out", tmp_path)
    assert (answer.status, answer.err.count("\n")) == (2, 1)
    assert "--overwrite" in answer.err
    assert [path.name for path in tmp_path.iterdir()] == [f"{NAME.format(1)}.npz"]
    answer = run("kinarm-train", *arguments, "--jobs", 1, "--out", tmp_path, "--overwrite")
    assert answer.status == 0, answer.err
    check_equal(Policy.load(tmp_path / f"{NAME.format(1)}.npz"), train_policy(config(1)).policy)
