"""``kinarm-bench``: JSON alone, a table or files, from the same figures."""

import json
from functools import partial

import pytest
from refusals import check_refused

from kinarm.evaluation import bench
from kinarm.policies import recipe

EVALUATION = {
    "seconds_first": 23.4,
    "seconds_without_bounds": 9.87,
    "seconds": 4.32,
    "peak_memory_mb": 321.0,
}
DOCUMENT = {
    "machine": {"architecture": "x86_64", "threads": 2},
    "versions": {"python": "3.11"},
    "repetitions": 7,
    "policy": "mine",
    "rollouts": [
        {
            "batch": 512,
            "actions": "trained",
            "threads": 2,
            "judged_share": 0.0125,
            "steps_per_second": {"median": 1234567.0, "best": 2345678.0},
        }
    ],
    "vector_environment": {"median": 400001.0, "best": 400002.0},
    "single_environment": {"median": 20001.0, "best": 20002.0},
    "reference": {"median": 5001.0, "best": 5002.0},
    "speed_up_over_reference": 246.8,
    "table_1_training": {
        "seconds": {"median": 1.52, "best": 1.41},
        "environment_steps": 2_300_000,
    },
    "oracle": {"trials": 200, "trials_per_second": {"median": 31.0, "best": 37.0}},
    "evaluation": EVALUATION,
    "ppo_training": {
        "seconds": 98.76,
        "environment_steps": 1_200_000,
    },
}
FIGURES = (
    *("1,234,567", "2,345,678", "400,001", "20,001", "5,001", "247 x", "1.250 %", "1.52 s"),
    *("6.5 s", "5.4 s", "23.4 s", "9.9 s", "4.3 s", "321 MB", "98.8 s"),
    "2.3 million steps",
)


def test_json_alone_is_printed(run, policy_folder, monkeypatch):
    for name in ("BATCHES", "VECTOR_ENVS", "ORACLE_TRIALS", "REFERENCE_TRIALS"):
        monkeypatch.setattr(bench, name, (512,) if name == "BATCHES" else 2)
    monkeypatch.setattr(bench, "measure_evaluation", lambda: EVALUATION)
    monkeypatch.setattr(bench, "recipe", partial(recipe, iterations=2))
    path = policy_folder / "mine-seed0.npz"
    answer = run("kinarm-bench", "--json", "--repetitions", 1, "--policy", path)
    document = json.loads(answer.out)
    assert (answer.status, answer.err) == (0, "")
    assert set(DOCUMENT) - set(document) == {"ppo_training"}
    assert document["policy"] == str(path)
    assert document["oracle"]["trials_per_second"]["median"] > 0
    fast = document["rollouts"][-1]["steps_per_second"]["median"]
    assert document["speed_up_over_reference"] == fast / document["reference"]["median"]


@pytest.fixture
def asked(monkeypatch):
    """Nothing is measured; what was asked for is listed."""
    found = []
    monkeypatch.setattr(bench, "measure", lambda *_, **more: found.append(more) or DOCUMENT)
    return found


def test_table_and_files_show_every_figure(run, asked, tmp_path):
    answer = run("kinarm-bench", "--ppo", "--out", tmp_path / "speed")
    assert (answer.status, answer.err, asked) == (0, "", [{"ppo": True}])
    page = (tmp_path / "speed" / "SPEED.md").read_text()
    for shown in (page, " ".join(answer.out.split())):
        assert not [figure for figure in FIGURES if figure not in shown]
    made = json.loads((tmp_path / "speed" / "speed.json").read_text())
    assert made.pop("command") in page
    assert made == DOCUMENT


def test_folder_that_cannot_be_written_is_refused_before_anything_is_measured(run, asked, tmp_path):
    (tmp_path / "file").touch()
    check_refused(run("kinarm-bench", "--out", tmp_path / "file"), "cannot write")
    assert asked == []
