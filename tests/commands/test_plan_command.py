"""``kinarm-plan``: its files, and one line and an exit status that say why not."""

import json

import pytest
from refusals import check_refused

from kinarm.problem import PROBLEMS
from kinarm.scene import Obstacle, Scene

GOAL = ("--goal-kind", "position", "--goal", "0.4", "0.5", "0.4")


def test_all_outputs(run, tmp_path):
    files = [tmp_path / f"m.{kind}" for kind in ("csv", "json", "html")]
    words = [word for file in files for word in ("--out", file)]
    answer = run("kinarm-plan", *GOAL, "--margin", "0.02", "--rate", "20", *words)
    assert answer.status == 0, answer.err
    assert "tested pairs of bodies come within 0.02 m at any time" in answer.out
    assert all(file.stat().st_size for file in files)
    times = [float(row.split(",")[0]) for row in files[0].read_text().split()[1:]]
    points = json.loads(files[1].read_text())["points"]
    assert len(times) == len(points)
    assert f"{times[-1]:.3f} s; none of" in answer.out
    assert times[1] == 0.05
    check_refused(run("kinarm-plan", *GOAL, *words), "exists", "--overwrite")
    assert run("kinarm-plan", *GOAL, *words, "--overwrite").status == 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), ("--goal",)),
        (("--goal", "0", "0"), ("goal must have shape (6)",)),
        (("--goal", "0", "1.9", "0", "0", "0", "0"), ("goal is in contact", "ground")),
        ((*GOAL[:3], "3", "0", "0"), ("goal is out of reach",)),
        ((*GOAL, "--start-kind", "pose", "--start", "1"), ("start must have shape (6)",)),
        ((*GOAL, "--margin", "-1"), ("margin must not be negative",)),
        ((*GOAL, "--out", "m.txt"), (".csv, .json, .html", "m.txt")),
    ],
)
def test_bad_input_is_one_line(run, words, said):
    check_refused(run("kinarm-plan", *words), *said)


def test_no_path_is_status_1(run, tmp_path):
    wall = Obstacle(name="wall", lower=(0.35, -0.06, 0.0), upper=(0.8, 0.06, 0.9))
    PROBLEMS["both"].replace(scene=Scene(obstacles=(wall,))).save(tmp_path / "walled.toml")
    here = ("0.9", "0.3", "0", "0", "0.2", "0")
    ends = ("--start", f"-{here[0]}", *here[1:], "--goal", *here)
    words = "kinarm-plan", "--problem", tmp_path / "walled.toml", *ends
    assert run(*words).status == 0
    answer = run(*words, "--samples", "0")
    assert answer.status == 1
    assert answer.err.count("\n") == 1
    assert "no path found with 0 samples" in answer.err
