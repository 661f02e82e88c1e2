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
        ("--arm missing.urdf", ["missing.urdf"]),
        ("--policy nobody", ["'nobody'", "random, zero"]),
        ("--policy nobody.npz", ["nobody.npz", "No such file"]),
        ("--trials 0", ["trials", "at least 1, got 0"]),
        ("--trials 2.5", ["--trials", "'2.5'"]),
        ("--seed -1", ["seed", "at least 0, got -1"]),
        ("stray", ["stray"]),
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
        ("ars --recipe nothing", ["'nothing'", "paper, tuned"]),
        ("ars --arm nobody", ["'nobody'", ARMS]),
        ("ars --seed -1", ["seed", "at least 0, got -1"]),
        ("ars --directions many", ["--directions", "'many'"]),
        ("ars --top-directions 25", ["top_directions", "24"]),
        ("ars --noise nan", ["--noise", "finite"]),
        ("ars --reward-collision 2", ["collision", "other sign"]),
        ("ars --tensorboard logs", ["--tensorboard"]),
        ("ars --sharing all", ["--sharing", "'all'"]),
        ("ars --resume", ["nothing to resume"]),
        ("ppo --batch-size 300", ["batch_size", "2000 steps"]),
        ("ppo --net-arch 0", ["net_arch"]),
        ("ppo --learning-rate 0", ["learning_rate", "greater than 0"]),
        ("ppo --gamma 2", ["gamma", "[0, 1]"]),
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
        ("kinarm-train ars --out p.npz --what=5", "--what=5 (see kinarm-train ars --help)"),
        ("kinarm-problem check --trails=5", "did you mean --trials? (see kinarm-problem check "),
        ("kinarm-bench --repetitons 2", "did you mean --repetitions?"),
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


@pytest.mark.parametrize(
    ("option", "name"),
    [
        ("--out", "evaluation.json"),
        ("--report", "index.html"),
    ],
)
def test_results_that_cannot_be_written_are_refused(run, tmp_path, option, name):
    (tmp_path / name).mkdir()
    arguments = ("--policy", "zero", "--task", "left", "--trials", 1, option, tmp_path)
    check_refused(run("kinarm-eval", *arguments), str(tmp_path))


@pytest.mark.parametrize("out", ["p.txt", "p", "file/p.npz"])
def test_a_policy_that_cannot_be_written_is_refused_before_training(run, tmp_path, out):
    (tmp_path / "file").write_text("mine")
    answer = run("kinarm-train", "ars", "--iterations", 1, "--out", tmp_path / out)
    check_refused(answer, out.split("/")[0])
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")  # noqa: PTH110
@pytest.mark.parametrize(("extra", "unbuffered"), [((), "1"), (("--json",), "")])
def test_a_full_disk_is_reported_in_one_line(run_outside, extra, unbuffered, monkeypatch):
    monkeypatch.setenv("PYTHONUNBUFFERED", unbuffered)
    arguments = ("--policy", "zero", "--task", "left", "--trials", 1, *extra)
    with open("/dev/full", "w") as full:  # noqa: PTH123
        answer = run_outside("kinarm-eval", *arguments, stdout=full)
    assert answer.status in (1, 2)
    assert len(answer.err.splitlines()) == 1, answer.err
