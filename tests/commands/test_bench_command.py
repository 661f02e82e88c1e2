"""``kinarm-bench``: JSON alone, or a table, from the same figures."""

import json
import re
from functools import partial

import pytest

from kinarm.evaluation.commands import bench
from kinarm.evaluation.measurements import (
    benchmark,
    environments,
    limits,
    oracle,
    pictures,
    table,
    training,
)
from kinarm.evaluation.measurements.document import speed_page
from kinarm.policies import recipe

EVALUATION = {
    "seconds_first": 23.4,
    "seconds_without_bounds": 9.87,
    "seconds": 4.32,
    "peak_memory_mb": 321.0,
}
ROW = {"batch": 512, "actions": "trained", "threads": 2, "judged_share": 0.0125}
RATE = {"median": 1234567.0, "best": 2345678.0}
DOCUMENT = {
    "machine": {"architecture": "x86_64", "threads": 2},
    "versions": {"python": "3.11"},
    "repetitions": 7,
    "policy": "mine",
    "rollouts": [{**ROW, "steps_per_second": RATE}],
    "attainable": {
        "operations_per_second": {"median": 57.6e9, "best": 58.4e9},
        "steps_per_second": {"median": 2_000_000.0, "best": 3_000_000.0},
    },
    "robots": [
        {"arm": "ur5", **ROW, "steps_per_second": {"median": 31001.0, "best": 32002.0}},
    ],
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
    "evaluation": EVALUATION,
    "ppo_training": {
        "seconds": 98.76,
        "environment_steps": 1_200_000,
        "simulator_share": 0.0721,
    },
    "studies": {
        "trainings": 200,
        "table_1_seconds": 143.2,
        "speed_up": {"ars": 1.87, "ppo": 1.93},
        "overhead": 0.0261,
        "loaded": 1000,
        "load_seconds": 1.234,
        "bytes_each": 4321.0,
        "planned_per_second": 3456.7,
        "kept_per_second": 234.5,
    },
    "limits": {
        "operations": {
            "total": 2100.0,
            "kinds": {"sums": 1100.0, "products": 1000.0},
            "functions": {"kinarm.kernels.kinematics.turn": 2095.0, "kinarm.tiny": 5.0},
        },
        "share_of_attainable": 0.073,
        "time": {"rollouts of 4096 episodes": {"compiled kernels": 0.87, "numpy": 0.13}},
    },
    "peers": [
        {
            "peer": "mujoco 3",
            "what": "rollouts",
            "unit": "steps/s",
            "theirs": {"median": 210001.0, "best": 220002.0},
            "ours": {"median": 8_000_003.0, "best": 9e6},
            "ratio": 38.1,
            "terms": "same starts",
        },
        {"peer": "panda-gym", "skipped": "panda-gym is not installed: pip install 'kinarm[peers]'"},
    ],
}


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Sizes for a test."""
    monkeypatch.setattr(benchmark, "BATCHES", (512,))
    monkeypatch.setattr(environments, "VECTOR_ENVS", 4)
    monkeypatch.setattr(limits, "BATCH", 6)
    monkeypatch.setattr(limits, "TURNS", 1000)
    monkeypatch.setattr(oracle, "ORACLE_TRIALS", 4)
    monkeypatch.setattr(pictures, "PICTURES", 2)
    monkeypatch.setattr(benchmark, "measure_evaluation", lambda: EVALUATION)
    monkeypatch.setattr(benchmark, "measure_robots", lambda _: [{"skipped": "no robots here"}])
    monkeypatch.setattr(training, "recipe", partial(recipe, iterations=2))


def test_json_alone_is_printed(run, policy_folder, monkeypatch):
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
        "attainable",
        "robots",
        "speed_up_over_reference",
        "table_1_training",
        "oracle",
        "evaluation",
    } <= set(document)
    assert document["policy"] == str(path)
    asked = []
    monkeypatch.setattr(benchmark, "measure", lambda *given, **_: asked.append(given) or document)
    assert bench.BenchmarkRequest(policy=str(path), repetitions=1).run() == document
    assert asked == [(str(path), 1)]


def test_table_shows_every_figure(run, monkeypatch):
    asked = []
    monkeypatch.setattr(
        benchmark, "measure", lambda *_, **options: asked.append(options) or DOCUMENT
    )
    answer = run("kinarm-bench", "--ppo", "--limits", "--peers", "--studies")
    assert asked == [{"ppo": True, "limits": True, "peers": True, "studies": True}]
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
        "143 s",
        "1.87 x",
        "1.93 x",
        "2.6 %",
        "1.23 s",
        "4 kB each",
        "3,457 a second",
        "234 a second",
        "1.250 %",
        "1.52",
        "6.5 s",
        "5.4 s",
        "9.9 s",
        "4.3 s",
        "321 MB",
        "98.8 s",
        "7.2%",
        "31,001",
        "57.6 billion/s",
        "2,100 floating-point operations (1,100 sums, 1,000 products)",
        "4.2 of 57.6 billion",
        "kinematics.turn",
        "99.8%",
        "compiled kernels 87%",
        "210,001",
        "8,000,003",
        "38.1",
        "skipped",
    ):
        assert figure in " ".join(answer.out.split()), figure
    assert "tiny" not in answer.out


def test_table_of_what_is_always_measured(run, monkeypatch):
    """Without the extras, and without what is only measured if it is asked for."""
    reason = "robots are not installed"
    asked_for = ("limits", "peers", "ppo_training", "studies")
    plain = {name: figures for name, figures in DOCUMENT.items() if name not in asked_for}
    skipped = {"robots": [{"skipped": reason}], "stable_baselines3": {"skipped": reason}}
    monkeypatch.setattr(benchmark, "measure", lambda *_, **__: {**plain, **skipped})
    answer = run("kinarm-bench")
    assert (answer.status, answer.err) == (0, "")
    shown = " ".join(re.sub("[^\\w\\s.()-]", "", answer.out).split())
    assert f"arms with meshes skipped {reason}" in shown
    assert f"for Stable-Baselines3 skipped {reason}" in shown
    assert "training of Table 1 (2.3 million steps) 1.52 s 1.41 s oracle" in shown
    for missing in ("PPO", "study", "peers", "spent in", "DummyVecEnv"):
        assert missing not in shown


def test_training_that_was_skipped_says_why(run, monkeypatch):
    reason = "torch is not installed: pip install 'kinarm[ppo]'"
    assert table._ppo_rows({"skipped": reason}) == [("training with PPO", "skipped"), (reason,)]


class TestFiles:
    def test_document_and_page(self, run, monkeypatch, tmp_path):
        monkeypatch.setattr(benchmark, "measure", lambda *_, **__: DOCUMENT)
        answer = run("kinarm-bench", "--out", tmp_path / "speed")
        assert (answer.status, answer.err) == (0, "")
        made = json.loads((tmp_path / "speed" / "speed.json").read_text())
        command = made.pop("command")
        assert command.startswith("kinarm-bench --out")
        assert made == DOCUMENT
        page = (tmp_path / "speed" / "SPEED.md").read_text()
        for part in (
            f"`{command}` on 2 threads",
            "| mujoco 3 | rollouts | 210,001 steps/s | 8,000,003 steps/s | 38.1 |",
            "- **mujoco 3**: same starts.",
            "| panda-gym | panda-gym is not installed: pip install 'kinarm[peers]' | skipped |",
            "| kinematics.turn | 2,095 | 99.8% |",
            "| rollouts of 4096 episodes | compiled kernels 87%, numpy 13% |",
            "| ur5, 512 trained episodes, 2 threads | 31,001 steps/s | 32,002 steps/s | 1.250 % |",
        ):
            assert part in page, part

    def test_page_without_what_was_not_asked_for(self):
        plain = {name: DOCUMENT[name] for name in DOCUMENT if name not in ("limits", "peers")}
        page = speed_page(plain, "kinarm-bench")
        assert "## Everything" in page
        assert "Peers" not in page
        assert "Operations" not in page

    def test_page_without_a_peer_that_is_installed(self):
        page = speed_page({**DOCUMENT, "peers": DOCUMENT["peers"][1:]}, "kinarm-bench")
        assert "| panda-gym | panda-gym is not installed" in page
        assert "- **" not in page

    def test_folder_that_cannot_be_written_is_refused_before_anything_is_measured(
        self, run, monkeypatch, tmp_path
    ):
        monkeypatch.setattr(benchmark, "measure", lambda *_, **__: pytest.fail("measured"))
        (tmp_path / "file").touch()
        answer = run("kinarm-bench", "--out", tmp_path / "file")
        assert answer.status == 2
        assert "cannot write" in answer.err
