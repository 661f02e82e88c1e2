"""The examples of every help are accepted, and those of short commands succeed."""

import shlex

import pytest

from kinarm.evaluation import EvaluationRequest
from kinarm.evaluation.commands.bench import BenchmarkRequest
from kinarm.evaluation.commands.replay import ReplayRequest
from kinarm.evaluation.commands.reproduce import ReproductionRequest
from kinarm.evaluation.commands.study import StudyRequest
from kinarm.evaluation.commands.train import TrainRequest
from kinarm.problem import PROBLEMS

LONG = (
    *(BenchmarkRequest, EvaluationRequest, ReplayRequest, ReproductionRequest),
    *(StudyRequest, TrainRequest),
)
"""What takes long to run: it is enough that it could begin."""

ELSEWHERE = (" status ", "my_module:LEARNER", "my.urdf", "ur5", "--address", ">")
"""Parts of examples that need what is not there, or a shell, or only read."""


class AcceptedError(Exception):
    """An example is accepted, and the work could begin."""


@pytest.fixture
def examples_of(run, tmp_path, monkeypatch, policy):
    """Examples at the end of a help, in a folder with the files that they speak of."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    for name in ("my.toml", "mine.toml"):
        PROBLEMS["right"].save(tmp_path / name)
    policy.save(tmp_path / "mine.npz")

    def examples(*words):
        _, _, text = run(*words, "--help").out.partition("examples:\n")
        lines = [line.strip() for line in text.splitlines() if line.startswith("  kinarm-")]
        shown = [line.partition("  ")[0] for line in lines]
        return [each for each in shown if not any(part in each for part in ELSEWHERE)]

    return examples


@pytest.mark.parametrize(
    ("words", "least"),
    [
        (("kinarm-bench",), 2),
        (("kinarm-eval",), 10),
        (("kinarm-replay",), 8),
        (("kinarm-reproduce",), 3),
        (("kinarm-study",), 6),
        (("kinarm-train",), 3),
        (("kinarm-train", "ars"), 4),
        (("kinarm-train", "ppo"), 4),
    ],
)
def test_what_takes_long_is_accepted(run, examples_of, monkeypatch, words, least):
    def accept(*_, **__):
        raise AcceptedError

    for request in LONG:
        monkeypatch.setattr(request, "run", accept)
    examples = examples_of(*words)
    assert len(examples) >= least
    for example in examples:
        with pytest.raises(AcceptedError):
            run(*shlex.split(example))


def check(run, examples):
    """See that examples succeed."""
    assert examples
    for example in examples:
        answer = run(*shlex.split(example))
        assert answer.status == 0, f"{example}: {answer.err}"


def test_examples_of_exporting(run, examples_of):
    pytest.importorskip("onnx")
    check(run, examples_of("kinarm-export"))


def test_examples_of_running(run, examples_of):
    pytest.importorskip("mujoco")
    check(run, examples_of("kinarm-run"))


def test_examples_of_planning(run, examples_of):
    check(run, examples_of("kinarm-plan"))


def test_examples_of_problems(run, examples_of):
    examples = examples_of("kinarm-problem")
    check(run, [f"{each} --trials 4" if " check " in each else each for each in examples])
