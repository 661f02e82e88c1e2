"""The benchmark measures what it says, on sizes small enough for a test."""

import json
import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from kinarm._parallel import available_threads
from kinarm.errors import WorkerError
from kinarm.evaluation.measurements import (
    benchmark,
    environments,
    limits,
    oracle,
    pictures,
    rollouts,
    timing,
    training,
)
from kinarm.evaluation.measurements import evaluation as measurements_of_evaluation
from kinarm.evaluation.measurements.evaluation import measure_evaluation
from kinarm.policies import recipe
from kinarm.problem import PROBLEMS
from kinarm.simulator import Simulator


@pytest.fixture(scope="module")
def document(train_novice, tmp_path_factory):
    path = tmp_path_factory.mktemp("bench") / "mine.npz"
    train_novice("left").save(path)
    with pytest.MonkeyPatch.context() as patch:
        shrink(patch)
        return benchmark.measure(str(path), 1)


def shrink(patch: pytest.MonkeyPatch) -> None:
    """Fewer batch sizes and trials, and a short training."""
    told_by = measurements_of_evaluation._told_by

    def told_by_less(command, env):
        fewer = ["1" if word == "200" else word for word in command]
        compiled = {"NUMBA_CACHE_DIR": os.environ.get("NUMBA_CACHE_DIR", "")}
        return told_by([*fewer, "--policy", "zero"], {**env, **compiled})

    patch.setattr(benchmark, "BATCHES", (6, 512))
    patch.setattr(environments, "VECTOR_ENVS", 8)
    patch.setattr(benchmark, "measure_robots", lambda _: [{"skipped": "not here"}])
    patch.setattr(limits, "BATCH", 6)
    patch.setattr(limits, "TURNS", 1000)
    patch.setattr(oracle, "ORACLE_TRIALS", 4)
    patch.setattr(pictures, "PICTURES", 2)
    patch.setattr(training, "recipe", partial(recipe, iterations=3))
    patch.setattr(measurements_of_evaluation, "_told_by", told_by_less)


def rates(document) -> list[dict[str, float]]:
    return [
        *(row["steps_per_second"] for row in document["rollouts"]),
        document["reference"],
        document["vector_environment"],
        document["single_environment"],
        document["pictures"],
        *document["attainable"].values(),
    ]


def test_document_is_plain_json(document):
    assert json.loads(json.dumps(document, allow_nan=False)) == document


def test_more_is_measured_where_it_is_asked_for(monkeypatch):
    fast = [{"batch": benchmark.HEADLINE_BATCH, "steps_per_second": {"median": 6.0}}]
    for name in [name for name in vars(benchmark) if name.startswith("measure_")]:
        found = SimpleNamespace(name=name, median=3.0, _asdict=dict)
        answer = fast if name == "measure_rollouts" else found
        monkeypatch.setattr(benchmark, name, lambda *_, answer=answer: answer)
    plain = benchmark.measure("ars-tuned-both", 1)
    more = dict.fromkeys(("ppo", "limits", "peers", "studies"), True)
    everything = benchmark.measure("ars-tuned-both", 1, **more)
    assert plain["speed_up_over_reference"] == 2.0
    assert set(everything) - set(plain) == {"ppo_training", "limits", "peers", "studies"}
    assert everything["studies"].name == "measure_studies"


def test_rates_are_positive(document):
    for rate in rates(document):
        assert 0 < rate["median"] <= rate["best"]


def test_rollouts_are_measured_in_every_combination(document):
    threads = {1, available_threads()}
    seen = {(row["batch"], row["actions"], row["threads"]) for row in document["rollouts"]}
    assert seen == {(b, a, t) for b in (6, 512) for a in ("random", "trained") for t in threads}
    assert len(document["rollouts"]) == len(seen)


def test_share_of_judged_configurations_is_a_share(document):
    assert all(0 <= row["judged_share"] <= 1 for row in document["rollouts"])


def test_training_of_table_1_is_measured(document):
    table_1 = document["table_1_training"]
    assert 0 < table_1["seconds"]["best"] <= table_1["seconds"]["median"]
    assert 3 * 48 <= table_1["environment_steps"] <= 3 * 48 * 64


def test_the_oracle_is_measured(document):
    rate = document["oracle"]["trials_per_second"]
    assert document["oracle"]["trials"] == 4
    assert 0 < rate["median"] <= rate["best"]


def test_the_evaluation_is_measured(document):
    seconds = {"seconds_first", "seconds_without_bounds", "seconds"}
    assert set(document["evaluation"]) == seconds | {"peak_memory_mb"}
    assert all(figure > 0 for figure in document["evaluation"].values())


def test_the_evaluation_is_measured_first_without_bounds_and_with_them(monkeypatch, own_cache):
    clock, seen = iter([0.0, 20.0, 20.0, 29.0, 30.0, 33.0]), []

    def told(command, env):
        folder = Path(env["KINARM_CACHE"])
        seen.append((folder, env.get("NUMBA_CACHE_DIR"), len(list(folder.iterdir()))))
        (folder / "bounds").touch()
        return b"204800\n"

    monkeypatch.setattr(measurements_of_evaluation, "_told_by", told)
    monkeypatch.setattr(time, "perf_counter", lambda: next(clock))
    figures = measure_evaluation()
    names = ("seconds_first", "seconds_without_bounds", "seconds")
    assert tuple(figures[name] for name in names) == (20, 9, 3)
    assert figures["peak_memory_mb"] == 200
    (first, compiled, empty), (folder, theirs, before), (again, as_theirs, after) = seen
    assert (compiled, theirs, as_theirs) == (str(first), *2 * [os.environ.get("NUMBA_CACHE_DIR")])
    assert (folder == again, empty, before, after) == (True, 0, 0, 1)
    assert not {own_cache, first} & {folder}
    assert not first.exists()
    assert not folder.exists()


def test_an_evaluation_that_fails_is_told():
    with pytest.raises(WorkerError, match="was to be measured ended unexpectedly"):
        measurements_of_evaluation._told_by([sys.executable, "-c", "raise SystemExit(3)"], {})


def test_an_evaluation_ends_with_an_interrupted_benchmark(monkeypatch):
    seen = []

    def communicate(process):
        seen.append(process)
        raise KeyboardInterrupt

    monkeypatch.setattr(subprocess.Popen, "communicate", communicate)
    with pytest.raises(KeyboardInterrupt):
        measurements_of_evaluation._told_by(["sleep", "600"], os.environ)
    assert seen[0].returncode == -signal.SIGKILL


def test_speed_up_is_the_ratio_of_two_figures(document):
    fast = [
        row["steps_per_second"]["median"]
        for row in document["rollouts"]
        if (row["batch"], row["actions"]) == (512, "trained")
    ]
    expected = fast[-1] / document["reference"]["median"]
    assert document["speed_up_over_reference"] == pytest.approx(expected)


def test_machine_and_versions_are_told(document):
    assert document["machine"]["threads"] == available_threads()
    assert {"python", "numpy", "numba"} <= set(document["versions"])
    assert document["repetitions"] == 1


def test_timing_divides_steps_by_time_and_leaves_out_the_first_run(monkeypatch):
    clock = iter([0.0, 2.0, 10.0, 11.0, 20.0, 24.0])
    runs = []
    monkeypatch.setattr(time, "perf_counter", lambda: next(clock))
    found = timing.timed(lambda: runs.append(1) or 8, 3)
    assert found == (4.0, 8.0)
    assert len(runs) == 4


def test_things_are_timed_by_turns_and_their_first_runs_are_not_counted(monkeypatch):
    clock = iter([0.0, 1.0, 1.0, 3.0, 3.0, 7.0, 7.0, 8.0])
    ran = []
    monkeypatch.setattr(time, "perf_counter", lambda: next(clock))
    found = timing.alternated(
        {"a": lambda: ran.append("a") or 4, "b": lambda: ran.append("b") or 8}, 2
    )
    assert ran == ["a", "b"] * 3
    assert found == {"a": (2.5, 4.0), "b": (6.0, 8.0)}


def test_measured_steps_are_steps_taken(monkeypatch, train_novice):
    """The rate of trained rollouts counts the steps of the episodes, not their horizon."""
    counted = []
    monkeypatch.setattr(
        rollouts, "timed", lambda run, _: counted.append(run()) or timing.Timing(1, 1)
    )
    simulator, policy = Simulator("right", threads=1), train_novice("right")
    rollouts.measure_rollouts(simulator, policy, 32, 1)
    starts, goals = simulator.sample(np.random.default_rng(32), 32)
    steps = int(simulator.rollout(policy, starts, goals).steps.sum())
    assert steps < 32 * 64
    assert counted[-1] == steps


def test_environments_are_measured_with_all_their_arms(monkeypatch):
    counted = []
    monkeypatch.setattr(
        environments, "timed", lambda run, _: counted.append(run()) or timing.Timing(1, 1)
    )
    environments.measure_vector_env(PROBLEMS["right"], 1)
    assert counted[0] == 64 * 200


class TestStableBaselines3:
    def test_speed_up_is_the_ratio_of_both(self, document):
        pytest.importorskip("stable_baselines3")
        rates = document["stable_baselines3"]
        for name in ("native", "dummy"):
            assert 0 < rates[name]["median"] <= rates[name]["best"]
        assert rates["speed_up"] == rates["native"]["median"] / rates["dummy"]["median"]

    def test_both_are_of_the_problem_with_all_arms(self, monkeypatch):
        pytest.importorskip("stable_baselines3")
        made, counted = [], []
        make, vec_env = environments.gymnasium.make, environments.sb3_vec_env
        monkeypatch.setattr(
            environments.gymnasium, "make", lambda *a, **k: made.append(make(*a, **k)) or made[-1]
        )
        monkeypatch.setattr(
            environments, "sb3_vec_env", lambda *a, **k: made.append(vec_env(*a, **k)) or made[-1]
        )
        monkeypatch.setattr(
            environments, "timed", lambda run, _: counted.append(run()) or timing.Timing(1, 1)
        )
        problem = PROBLEMS["left"].replace(horizon=9)
        environments.measure_sb3(problem, 1)
        assert counted == [64 * 200, 64 * 20]
        assert len(made) == 65
        assert {env.get_wrapper_attr("simulator").problem for env in made[1:]} == {problem}
        assert made[0].simulator.problem == problem

    def test_skipped_without_it(self, monkeypatch):
        monkeypatch.setattr("kinarm.policies.learners.find_spec", lambda name: None)
        assert "kinarm[ppo]" in environments.measure_sb3(PROBLEMS["left"], 1)["skipped"]


class TestPPO:
    @pytest.fixture
    def trained(self, monkeypatch):
        pytest.importorskip("stable_baselines3")
        tiny = {"iterations": 3, "n_envs": 4, "batch_size": 64, "net_arch": (8, 8)}
        monkeypatch.setattr(training, "recipe", partial(recipe, **tiny))
        return training.measure_ppo(PROBLEMS["left"])

    def test_share_of_the_simulator(self, trained):
        assert trained["environment_steps"] == 3 * 4 * 16
        assert trained["seconds"] > 0
        assert 0 < trained["simulator_share"] < 1
        assert json.loads(json.dumps(trained)) == trained

    def test_skipped_without_its_packages(self, monkeypatch):
        monkeypatch.setattr("kinarm.policies.learners.find_spec", lambda name: None)
        skipped = training.measure_ppo(PROBLEMS["left"])["skipped"]
        assert "pip install 'kinarm[ppo]'" in skipped
