"""``kinarm-compare``: a small comparison from end to end, resumed, and bad input."""

import json

import pytest

from kinarm.errors import InvalidInputError
from kinarm.evaluation.commands.compare import ComparisonRequest

SMALL = ("--problems", "right", "--steps", 3000, "--trials", 20, "--seeds", 1, "--jobs", 1)
RECIPES = ("--learners", "ars-paper", "ars-tuned")


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "out"


@pytest.fixture
def unpainted(monkeypatch):
    """Figures are drawn, but not written, which takes longer than the trainings."""
    monkeypatch.setattr("kinarm.evaluation.comparison.document.save_figure", lambda *_: ())


def test_there_must_be_a_problem():
    with pytest.raises(InvalidInputError, match="there is no problem to compare learners on"):
        ComparisonRequest(problems=())


def run_files(folder):
    return {path: path.stat().st_mtime_ns for path in (folder / "runs").iterdir()}


def test_a_small_comparison_and_again(run, folder):
    answer = run("kinarm-compare", *RECIPES, *SMALL, "--out", folder)
    assert answer.status == 0, answer.err
    assert "ARS, tuned" in answer.out
    assert f"written: {folder}/LEARNERS.md" in answer.out
    assert "2 of 2 trainings: ars-tuned-right-seed0" in answer.err
    finished = run_files(folder)
    assert len(finished) == 2
    assert {path.suffix for path in folder.glob("learners.*g")} == {".png", ".svg"}
    page = (folder / "LEARNERS.md").read_text()
    again = run("kinarm-compare", *RECIPES, *SMALL, "--out", folder)
    assert again.status == 0
    assert "trainings" not in again.err
    assert run_files(folder) == finished
    assert (folder / "LEARNERS.md").read_text() == page


@pytest.mark.usefixtures("unpainted")
def test_what_is_missing_is_trained_and_nothing_else(run, folder):
    run("kinarm-compare", *RECIPES[:2], *SMALL, "--out", folder)
    finished = run_files(folder)
    (path,) = finished
    content = json.loads(path.read_text())
    answer = run("kinarm-compare", *RECIPES, *SMALL, "--out", folder)
    assert "1 of 1 trainings: ars-tuned" in answer.err
    assert finished.items() <= run_files(folder).items()
    path.write_text("{")
    run("kinarm-compare", *RECIPES, *SMALL, "--out", folder)
    clocks = ("seconds", "processor_seconds")
    old, new = (
        [{name: value for name, value in point.items() if name not in clocks} for point in curve]
        for curve in (content["curve"], json.loads(path.read_text())["curve"])
    )
    assert old == new


@pytest.mark.usefixtures("unpainted")
def test_other_settings_leave_finished_trainings_alone(run, folder):
    run("kinarm-compare", *RECIPES[:2], *SMALL, "--out", folder)
    finished = run_files(folder)
    run("kinarm-compare", *RECIPES[:2], *SMALL, "--trials", 21, "--out", folder)
    both = run_files(folder)
    assert len(both) == 2
    assert finished.items() <= both.items()


@pytest.mark.usefixtures("unpainted")
def test_without_training(run, folder):
    run("kinarm-compare", *RECIPES[:2], *SMALL, "--out", folder)
    answer = run("kinarm-compare", *RECIPES, *SMALL[:-2], "--no-train", "--out", folder)
    assert answer.status == 0
    assert "ARS, paper" in answer.out
    assert "ARS, tuned" not in answer.out
    assert len(run_files(folder)) == 1


@pytest.mark.usefixtures("unpainted")
def test_from_python(folder):
    request = ComparisonRequest(
        learners=("ars-paper",),
        problems=("left",),
        seeds=2,
        steps=2000,
        trials=10,
        jobs=1,
        out=folder,
    )
    comparison = request.run()
    assert [len(series.curves) for series in comparison.series] == [2]
    document = json.loads((folder / "learners.json").read_text())
    assert document["command"].startswith("ComparisonRequest(")
    assert "learners=('ars-paper',)" in document["command"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--seeds", 0), ("seeds", "0")),
        (("--trials", 0), ("trials",)),
        (("--jobs", 0), ("jobs",)),
        (("--steps", "many"), ("--steps", "'many'")),
        (("--learners", "sarsa"), ("unknown learner 'sarsa'", "ars-paper", "sb3-tqc-her")),
        (("--problems", "up"), ("unknown problem 'up'", "both")),
        (("--problems", "left", "left"), ("two problems are called 'left'",)),
        (("--settings", "none.toml"), ("cannot read table of learners 'none.toml'",)),
        (("--learners", "ars-paper", "--no-train"), ("no training is finished in",)),
    ],
)
def test_bad_input_is_one_line(run, folder, arguments, words):
    answer = run("kinarm-compare", "--out", folder, *arguments)
    assert (answer.status, answer.out) == (2, "")
    assert len(answer.err.splitlines()) == 1
    for word in words:
        assert word in answer.err


def test_without_the_extra(run, folder, monkeypatch):
    monkeypatch.setattr("kinarm.policies.learners.find_spec", lambda name: None)
    answer = run("kinarm-compare", "--out", folder)
    assert answer.status == 2
    assert "pip install 'kinarm[" in answer.err
    assert not folder.exists()
