"""``kinarm-bench``: JSON alone or a table, from the same figures."""

import json

import pytest

from kinarm.evaluation import bench

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
    *("1,234,567", "2,345,678", "400,001", "20,001", "1.250 %", "1.52 s"),
    *("6.5 s", "5.4 s", "23.4 s", "9.9 s", "4.3 s", "321 MB", "98.8 s"),
    "2.3 million steps",
)


@pytest.fixture
def asked(monkeypatch):
    """Nothing is measured; what was asked for is listed."""
    found = []
    monkeypatch.setattr(bench, "measure", lambda *_, **more: found.append(more) or DOCUMENT)
    return found


def test_the_table_shows_every_figure(run, asked):
    answer = run("kinarm-bench", "--ppo")
    assert (answer.status, answer.err, asked) == (0, "", [{"ppo": True}])
    shown = " ".join(answer.out.split())
    assert not [figure for figure in ("kinarm-bench --ppo", *FIGURES) if figure not in shown]
    printed = json.loads(run("kinarm-bench", "--json").out)
    assert printed == {"command": "kinarm-bench --json", **DOCUMENT}
