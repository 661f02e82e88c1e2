"""The examples of every help succeed, as they are written but for their size."""

import shlex

import pytest

from kinarm.evaluation.commands.bench import BenchmarkRequest
from kinarm.evaluation.commands.reproduce import ReproductionRequest
from kinarm.evaluation.commands.study import StudyRequest
from kinarm.policies import Policy, recipe, train_policy
from kinarm.problem import PROBLEMS

SMALLER = {
    "kinarm-eval": ("--trials", 5, "--no-oracle"),
    "kinarm-train ppo": ("--iterations", 1, "--n-envs", 8, "--batch-size", 64),
    "kinarm-train": ("--iterations", 2),
    "kinarm-replay --play": ("--overwrite",),
    "kinarm-replay": ("--no-oracle", "--overwrite"),
    "kinarm-problem check": ("--trials", 4),
}
"""What examples are run with besides, by how they begin."""

LONG = {
    "kinarm-bench": BenchmarkRequest,
    "kinarm-reproduce": ReproductionRequest,
    "kinarm-study": StudyRequest,
}
"""Commands of which it is enough that they accept their examples."""

ELSEWHERE = (
    " status ",
    "my_module:LEARNER",
    "model.zip",
    "my.urdf",
    "ur5",
    "--address",
    ">",
)
"""Parts of examples that need what is not there, or a shell."""


class AcceptedError(Exception):
    """An example is accepted, and the work could begin."""


def examples_of(run, *words):
    """Examples at the end of a help."""
    _, _, text = run(*words, "--help").out.partition("examples:\n")
    lines = [line.strip() for line in text.splitlines() if line.startswith("  kinarm-")]
    return [line.partition("  ")[0] for line in lines]


@pytest.fixture
def place(tmp_path, monkeypatch, policy):
    """A folder with the files that examples speak of."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    for name in ("my.toml", "mine.toml"):
        PROBLEMS["right"].save(tmp_path / name)
    policy.save(tmp_path / "mine.npz")
    (tmp_path / "right").mkdir()
    for seed in (0, 1):
        made = train_policy(recipe("ars", "paper", problem="right", seed=seed, iterations=1))
        made.policy.save(tmp_path / "right" / f"{seed}.npz")
    text = "def my_policy(observations):\n    return 0 * observations[:, :5]\n"
    (tmp_path / "my_module.py").write_text(text)
    return tmp_path


def check(run, examples, *, least):
    """Run what can be run, and see that it succeeds."""
    done = 0
    for example in examples:
        program, *words = shlex.split(example)
        if any(part in example for part in ELSEWHERE):
            continue
        besides = (more for start, more in SMALLER.items() if example.startswith(start))
        answer = run(program, *words, *next(besides, ()))
        assert answer.status == 0, f"{example}: {answer.err}"
        done += 1
    assert done >= least


def test_examples_of_training(run, place):
    (place / "right" / "0.npz").unlink()
    check(run, examples_of(run, "kinarm-train", "ars"), least=4)
    assert Policy.load(place / "my.npz").problem == PROBLEMS["right"].pinned
    assert len(list((place / "right").glob("ars-tuned-right-seed?.npz"))) == 5


def test_examples_of_all_learners(run, place):
    check(run, examples_of(run, "kinarm-train"), least=3)


def test_examples_of_evaluating_and_replaying(run, place):
    check(run, examples_of(run, "kinarm-eval"), least=9)
    check(run, examples_of(run, "kinarm-replay"), least=7)


def test_examples_of_exporting(run, place):
    pytest.importorskip("onnx")
    check(run, examples_of(run, "kinarm-export"), least=2)


def test_examples_of_running(run, place):
    pytest.importorskip("mujoco")
    check(run, examples_of(run, "kinarm-run"), least=2)


def test_examples_of_planning(run, place):
    check(run, examples_of(run, "kinarm-plan"), least=3)


def test_examples_of_problems(run, place):
    check(run, examples_of(run, "kinarm-problem"), least=1)


@pytest.mark.parametrize("program", LONG)
def test_examples_of_what_takes_long_are_accepted(run, place, monkeypatch, program):
    def accept(*_, **__):
        raise AcceptedError

    monkeypatch.setattr(LONG[program], "run", accept)
    examples = [each for each in examples_of(run, program) if " status " not in each]
    assert examples
    for example in examples:
        _, *words = shlex.split(example)
        with pytest.raises(AcceptedError):
            run(program, *words)
