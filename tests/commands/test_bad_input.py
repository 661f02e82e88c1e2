"""Bad input: one line on standard error, exit status 2, nothing else printed, nothing lost."""

import os

import pytest
from refusals import check_refused

from kinarm import arm_names

ARMS = ", ".join(arm_names())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("--task upwards", ["'upwards'", "left, right, both"]),
        ("--arm nobody", ["'nobody'", ARMS, "path/to/robot.urdf, path/to/arm.toml"]),
        ("--policy nobody", ["'nobody'", "random, zero"]),
        ("--trials 0", ["trials", "at least 1, got 0"]),
        ("--seed -1", ["seed", "at least 0, got -1"]),
        ("stray", ["stray"]),
        ("--policy ars-tuned-both-seed0 --arm paper_flange", ["'paper_flange'", "'paper'"]),
        ("--vec-normalize none", ["--vec-normalize", "models of Stable-Baselines3"]),
        ("--json --markdown", ["exclude each other"]),
    ],
)
def test_eval_refuses(run, arguments, words):
    check_refused(
        run("kinarm-eval", "--policy", "zero", "--trials", "2", *arguments.split()), *words
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("ars --problem gone.toml", ["gone.toml", "No such file"]),
        ("ars --directions many", ["--directions", "'many'"]),
        ("ars --top-directions 25", ["top_directions", "24"]),
        ("ars --noise nan", ["--noise", "finite"]),
        ("ars --reward-collision 2", ["collision", "other sign"]),
        ("ppo --batch-size 300", ["batch_size", "2000 steps"]),
        ("ppo --net-arch 0", ["net_arch"]),
        ("ppo --directions 3", ["--directions"]),
    ],
)
def test_train_refuses(run, tmp_path, arguments, words):
    learner, *options = arguments.split()
    check_refused(run("kinarm-train", learner, "--out", tmp_path / "p.npz", *options), *words)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("kinarm-train ars --out p.npz --recepie tuned", "--recepie tuned; did you mean --recipe?"),
        ("kinarm-problem check --trails=5", "did you mean --trials? (see kinarm-problem check "),
        ("kinarm-eval --polcy zero", "did you mean --policy? (see kinarm-eval --help)"),
    ],
)
def test_an_unknown_option_is_refused_with_the_help_that_lists_it(run, words, told):
    program, *arguments = words.split()
    check_refused(run(program, *arguments), "unrecognized arguments: --", told)


@pytest.mark.parametrize("arguments", [[], ["nobody"], ["ars"], ["ppo"]])
def test_train_needs_a_learner_and_a_file(run, arguments):
    check_refused(run("kinarm-train", *arguments))


@pytest.mark.parametrize("option", ["--out", "--report"])
def test_an_output_folder_that_cannot_be_made_is_refused(run, tmp_path, option):
    (tmp_path / "file").write_text("mine")
    for out in (tmp_path / "file", tmp_path / "file" / "deep"):
        answer = run("kinarm-eval", "--policy", "zero", "--trials", 1, option, out)
        check_refused(answer, "file")
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.parametrize("out", ["p.txt", "p", "file/p.npz"])
def test_a_policy_that_cannot_be_written_is_refused_before_training(run, tmp_path, out):
    (tmp_path / "file").write_text("mine")
    answer = run("kinarm-train", "ars", "--iterations", 1, "--out", tmp_path / out)
    check_refused(answer, out.split("/")[0])
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")  # noqa: PTH110
@pytest.mark.parametrize("unbuffered", ["1", ""])
def test_a_full_disk_is_reported_in_one_line(run_outside, unbuffered, monkeypatch):
    monkeypatch.setenv("PYTHONUNBUFFERED", unbuffered)
    with open("/dev/full", "w") as full:  # noqa: PTH123
        answer = run_outside("kinarm-problem", "list", stdout=full)
    assert answer.status in (1, 2)
    assert len(answer.err.splitlines()) == 1, answer.err
