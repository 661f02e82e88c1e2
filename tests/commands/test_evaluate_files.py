"""``kinarm-eval``: files and reports that it writes."""

import json

import pytest
from refusals import check_refused

from kinarm.evaluation import bounds
from kinarm.evaluation.document import EvaluationDocument


def test_earlier_results_are_replaced_when_asked_for(run, tmp_path):
    (tmp_path / "evaluation.json").write_text("old")
    (tmp_path / "notes.txt").write_text("mine")
    arguments = ("--policy", "zero", "--problem", "left", "--trials", 2, "--out", tmp_path)
    refused = run("kinarm-eval", *arguments)
    assert refused.status == 2
    assert "evaluation.json' exists: --overwrite replaces it" in refused.err
    assert (tmp_path / "evaluation.json").read_text() == "old"
    run("kinarm-eval", *arguments, "--overwrite")
    assert json.loads((tmp_path / "evaluation.json").read_text())["protocol"]["trials"] == 2
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_files_are_the_same_from_every_process(run, run_outside, policy_folder, tmp_path):
    made = tmp_path / "made"
    arguments = ("--policy", policy_folder / "mine-seed0.npz", "--policy", "zero", "--trials", 9)
    files = ("--out", made, "--report", made, "--overwrite")  # whose names are in the report
    contents = []
    for call in (run, run_outside):
        assert call("kinarm-eval", *arguments, *files).status == 0
        contents.append({path.name: path.read_bytes() for path in made.iterdir()})
    one, other = contents
    assert set(one) == {"evaluation.json", "index.html"}
    assert one["index.html"] == other["index.html"]
    first, second = (json.loads(each["evaluation.json"]) for each in contents)
    assert first["results"] == second["results"]
    assert first["protocol"]["problems"] == second["protocol"]["problems"]
    assert first["protocol"]["versions"] == second["protocol"]["versions"]


def test_the_report_of_more_trials_than_are_bounded(run, policy_folder, tmp_path, monkeypatch):
    monkeypatch.setattr(bounds, "MOST_BOUNDED", 4)
    arguments = ("--policy", policy_folder / "mine-seed0.npz", "--trials", 9, "--hold")
    files = ("--report", tmp_path, "--out", tmp_path)
    answer = run("kinarm-eval", *arguments, *files)
    assert (answer.status, answer.err) == (0, "")
    assert "not asked" in (tmp_path / "index.html").read_text(encoding="utf-8")
    document = EvaluationDocument.load(tmp_path / "evaluation.json")
    assert document.protocol.problems["right"].oracle.bounded == 4


class TestColumns:
    def test_the_table_has_the_named_ones(self, run):
        asked = ("--policy", "zero", "--problem", "left", "--trials", 2, "--no-oracle")
        answer = run("kinarm-eval", *asked, "--columns", "max_distance, collision")
        assert answer.out.splitlines()[0].split("  ")[-2:] == ["max distance m", "collision %"]

    @pytest.mark.parametrize(
        ("options", "words"),
        [
            (("--columns", "colision"), "unknown column 'colision' (did you mean 'collision'?)"),
            (("--columns", "success", "--json"), "--columns is for tables"),
            (("--markdown", "--json"), "--json and --markdown exclude each other"),
        ],
    )
    def test_bad_options_are_refused_before_any_work(self, run, monkeypatch, options, words):
        monkeypatch.setattr("kinarm.evaluation.evaluation.run_trials", None)
        check_refused(run("kinarm-eval", *options), words)
