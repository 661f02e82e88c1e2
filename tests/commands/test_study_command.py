"""``kinarm-study`` as users run it."""

import csv
import json

import pytest

STUDY = """
problems = ["right"]
seeds = 3

[trials]
count = 10

[fixed]
iterations = 4
directions = 4
top_directions = 2

[grid]
step_size = [0.02, 0.2]
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "steps.toml"
    path.write_text(STUDY)
    return path


def test_from_a_file_to_a_page(run, file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    answer = run("kinarm-study", "steps.toml", "--jobs", 1)
    assert answer.status == 0, answer.err
    assert answer.out.splitlines()[-1] == (
        "written: steps/index.html, with tables and figures beside it"
    )
    assert "step_size=0.02" in answer.out
    page = (tmp_path / "steps" / "index.html").read_text()
    assert "kinarm-study steps.toml --jobs 1" in page
    status = run("kinarm-study", "status", "steps")
    assert (status.status, status.out) == (0, "steps: 6 of 6 trainings finished\n")


@pytest.mark.parametrize("width", [80, 120])
def test_rows_differ_and_files_hold_all(run, file, tmp_path, monkeypatch, width):
    monkeypatch.setenv("COLUMNS", str(width))
    monkeypatch.chdir(tmp_path)
    file.write_text(STUDY.replace("seeds = 3", "seeds = 1") + "noise = [0.0123456789, 0.987654]")
    answer = run("kinarm-study", "steps.toml", "--jobs", 1)
    lines = answer.out.splitlines()
    assert max(map(len, lines)) <= width
    for text in ("step_size=0.02", "noise=0.0123457", "noise=0.987654"):
        assert sum(text in line.split() for line in lines) == 2
    answer = run("kinarm-study", "steps.toml", "--no-train", "--columns", "success,collision")
    assert answer.out.split()[:4] == ["trainings", "success", "%", "collision"]
    with (tmp_path / "steps" / "runs.csv").open() as file:
        rows = list(csv.DictReader(file))
    pairs = {(float(row["step_size"]), float(row["noise"])): row["success"] for row in rows}
    assert pairs.keys() == {(a, b) for a in (0.02, 0.2) for b in (0.0123456789, 0.987654)}
    document = json.loads((tmp_path / "steps" / "results.json").read_text())
    for each in document["results"]:
        row = pairs[each["choices"]["step_size"], each["choices"]["noise"]]
        assert float(row) == each["success"]["value"]


def test_what_is_finished_can_be_written_without_training(run, file, tmp_path):
    out = tmp_path / "it"
    answer = run("kinarm-study", file, "--out", out, "--no-train")
    assert (answer.status, answer.out) == (0, "no training is finished\n")
    assert not out.exists()


def test_failures(run, file, tmp_path, monkeypatch):
    def fail(*_, **__):
        raise ValueError("of all things")

    monkeypatch.setattr("kinarm.evaluation.experiments.study.train", fail)
    answer = run("kinarm-study", file, "--out", tmp_path / "it", "--jobs", 1)
    assert answer.status == 1
    assert "6 of 6 trainings failed: ars paper* right seed 0, step_size 0.02: of" in answer.err


class TestBadInput:
    @pytest.mark.parametrize(
        ("text", "words"),
        [
            ("seeds = 'many'", "steps.toml: seeds must be a whole number, got 'many'"),
            ("seeds = ", "steps.toml: not an experiment file: Invalid value"),
        ],
    )
    def test_a_file(self, run, file, tmp_path, text, words):
        file.write_text(text)
        answer = run("kinarm-study", file, "--out", tmp_path / "it")
        assert answer.status == 2
        assert words in answer.err
        assert len(answer.err.splitlines()) == 1
        assert not (tmp_path / "it").exists()

    @pytest.mark.parametrize(
        ("arguments", "words"),
        [
            (("steps.toml", "--jobs", 0), "jobs must be a whole number of at least 1"),
            (("status", "."), "there is no study in"),
        ],
    )
    def test_options(self, run, file, tmp_path, monkeypatch, arguments, words):
        monkeypatch.chdir(tmp_path)
        answer = run("kinarm-study", *arguments)
        assert answer.status == 2
        assert words in answer.err
