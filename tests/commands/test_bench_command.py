"""``kinarm-bench``: JSON alone, or a table, from the same figures."""

import json
from functools import partial

import pytest

from kinarm.evaluation import measurements
from kinarm.evaluation.commands import bench
from kinarm.policies import recipe


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Sizes for a test."""
    evaluation = {"seconds_without_bounds": 9.87, "seconds": 4.32, "peak_memory_mb": 321.0}
    monkeypatch.setattr(measurements, "BATCHES", (512,))
    monkeypatch.setattr(measurements, "ORACLE_TRIALS", 4)
    monkeypatch.setattr(measurements, "PICTURES", 2)
    monkeypatch.setattr(measurements, "measure_evaluation", lambda: evaluation)
    monkeypatch.setattr(measurements, "recipe", partial(recipe, iterations=2))


def test_json_alone_is_printed(run, policy_folder):
    path = policy_folder / "mine-seed0.npz"
    answer = run("kinarm-bench", "--json", "--repetitions", 1, "--policy", path)
    document = json.loads(answer.out)
    assert (answer.status, answer.err) == (0, "")
    assert {
        "rollouts",
        "vector_environment",
        "single_environment",
        "stable_baselines3",
        "pictures",
        "reference",
        "speed_up_over_reference",
        "table_1_training",
        "oracle",
        "evaluation",
    } <= set(document)
    assert document["policy"] == str(path)
    request = bench.BenchmarkRequest(policy=str(path), repetitions=1)
    assert set(request.run()) == set(document)


def test_table_shows_every_figure(run, monkeypatch, policy_folder):
    row = {"batch": 512, "actions": "trained", "threads": 2, "judged_share": 0.0125}
    rate = {"median": 1234567.0, "best": 2345678.0}
    document = {
        "policy": "mine",
        "rollouts": [{**row, "steps_per_second": rate}],
        "vector_environment": {"median": 400001.0, "best": 400002.0},
        "single_environment": {"median": 20001.0, "best": 20002.0},
        "stable_baselines3": {
            "native": {"median": 450001.0, "best": 450002.0},
            "dummy": {"median": 15001.0, "best": 15002.0},
            "speed_up": 30.4,
        },
        "pictures": {"median": 53.0, "best": 59.0},
        "reference": {"median": 5001.0, "best": 5002.0},
        "speed_up_over_reference": 246.8,
        "table_1_training": {
            "seconds": {"median": 1.52, "best": 1.41},
            "environment_steps": 2_300_000,
        },
        "oracle": {"trials": 200, "trials_per_second": {"median": 31.0, "best": 37.0}},
        "evaluation": measurements.measure_evaluation(),
        "ppo_training": {
            "seconds": 98.76,
            "environment_steps": 1_200_000,
            "simulator_share": 0.0721,
        },
    }
    asked = []
    monkeypatch.setattr(measurements, "measure", lambda *_, ppo: asked.append(ppo) or document)
    answer = run("kinarm-bench", "--ppo")
    assert asked == [True]
    for figure in (
        "1,234,567",
        "2,345,678",
        "400,001",
        "20,001",
        "450,001",
        "15,002",
        "30 x",
        "53 pictures/s",
        "5,001",
        "247 x",
        "1.250 %",
        "1.52",
        "6.5 s",
        "5.4 s",
        "9.9 s",
        "4.3 s",
        "321 MB",
        "98.8 s",
        "7.2%",
    ):
        assert figure in answer.out, figure


def test_training_that_was_skipped_says_why(run, monkeypatch):
    reason = "torch is not installed: pip install 'kinarm[ppo]'"
    assert bench._ppo_rows({"skipped": reason}) == [("training with PPO", "skipped"), (reason,)]
