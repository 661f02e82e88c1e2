"""Writes that fail, places where commands run, and several processes on one folder."""

import pytest

from kinarm._files import only_writer
from kinarm.evaluation.commands import bench, compare, evaluate, reproduce

from .command_lines import inside
from .faults import FAULTS
from .surroundings import PLACES, half_written, run_in, unfit_answer
from .writes import WRITERS, WriteJudge, contents, run_writer

TURNS = 16
"""Calls that fail of every command, one after the other, about."""

QUICK = ("training of a comparison", "training of a reproduction")


@pytest.mark.parametrize(
    "name",
    [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in WRITERS],
)
def test_each_write_fails_in_turn(name, tmp_path, monkeypatch):
    monkeypatch.setenv("KINARM_CACHE", str(tmp_path / "cache"))
    judge = WriteJudge(name, tmp_path)
    assert judge.points > 2
    total = judge.points * len(FAULTS) * 2
    turns = range(0, total, max(1, total // TURNS) | 1)
    found = {number: judge(number).finding for number in turns}
    assert {number: finding for number, finding in found.items() if finding} == {}


@pytest.mark.slow
@pytest.mark.parametrize("command", ["train", "replay"])
@pytest.mark.parametrize("place", PLACES)
def test_commands_end_well_anywhere(place, command, tmp_path):
    assert unfit_answer(run_in(place, command, tmp_path)) == ""
    assert half_written(tmp_path) == []


@pytest.mark.parametrize(
    ("main", "arguments"),
    [
        (bench.main, ["--repetitions", "1"]),
        (compare.main, ["--no-train", "--learners", "ars-paper"]),
        (evaluate.main, ["--policy", "zero", "--problem", "left", "--trials", "1"]),
        (reproduce.main, ["--quick", "--no-ppo"]),
    ],
)
def test_one_process_at_a_time_writes_to_a_folder(main, arguments, tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    with inside(tmp_path), only_writer(folder):
        status, said = run_writer(lambda: main([*arguments, "--out", "out"]))
    assert status == 2
    assert len(said.splitlines()) == 1
    assert "another process is writing" in said
    assert [path.name for path in folder.rglob("*") if path.is_file()] == []
    assert contents(tmp_path) == {}
