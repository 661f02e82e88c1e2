"""The benchmark measures what it says, on sizes small enough for a test."""

import json
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from kinarm._parallel import available_threads
from kinarm.errors import WorkerError
from kinarm.evaluation import bench
from kinarm.policies import recipe
from kinarm.problem import PROBLEMS
from kinarm.simulator import Simulator


@pytest.fixture
def counted(monkeypatch):
    """What is timed runs once, and its steps are listed."""
    steps = []
    rate = {"median": 1.0, "best": 1.0}
    monkeypatch.setattr(bench, "timed", lambda run, _: steps.append(run()) or rate)
    return steps


def test_the_first_run_is_not_counted(monkeypatch):
    clock = iter([0.0, 1.0, 1.0, 3.0])
    steps = iter([100, 4, 5])
    monkeypatch.setattr(time, "perf_counter", lambda: next(clock))
    assert bench.timed(lambda: next(steps), 2) == {"median": 3.25, "best": 4.0}


def test_measured_steps_are_steps_taken(counted, train_novice):
    """The rate of trained rollouts counts the steps of the episodes, not their horizon."""
    simulator, policy = Simulator("right", threads=1), train_novice("right")
    rows = bench._measure_rollouts(simulator, policy, 32, 1)
    starts, goals = simulator.sample(np.random.default_rng(32), 32)
    steps = int(simulator.rollout(policy, starts, goals).steps.sum())
    assert steps < 32 * 64
    assert counted[-1] == steps
    threads = sorted({1, available_threads()})
    seen = [(row["actions"], row["threads"]) for row in rows]
    assert seen == [(actions, t) for actions in ("random", "trained") for t in threads]
    assert all(0 <= row["judged_share"] <= 1 for row in rows)


def test_everything_is_measured(counted, monkeypatch):
    """In a small way, but for the evaluation in a process of its own."""
    for name, value in (("BATCHES", (512,)), ("VECTOR_ENVS", 2), ("ORACLE_TRIALS", 2)):
        monkeypatch.setattr(bench, name, value)
    monkeypatch.setattr(bench, "recipe", partial(recipe, iterations=2))
    monkeypatch.setattr(bench, "measure_evaluation", dict)
    document = bench.measure("ars-paper-right-seed0", 1)
    assert json.loads(json.dumps(document)) == document
    assert document["rollouts"][-1]["steps_per_second"]["median"] == 1.0
    assert document["table_1_training"]["environment_steps"] > 0
    assert min(counted) > 0


def test_a_training_by_ppo(monkeypatch):
    tiny = {"iterations": 3, "n_envs": 4, "batch_size": 50, "net_arch": (8, 8)}
    monkeypatch.setattr(bench, "recipe", partial(recipe, **tiny))
    trained = bench.measure_ppo(PROBLEMS["left"])
    assert trained["environment_steps"] == 3 * 4 * 125
    assert json.loads(json.dumps(trained)) == trained


class TestEvaluation:
    def test_it_is_measured_first_without_bounds_and_with_them(self, monkeypatch, own_cache):
        seen = []

        def told(command, env):
            folder = Path(env["KINARM_CACHE"])
            seen.append((folder, env.get("NUMBA_CACHE_DIR"), len(list(folder.iterdir()))))
            (folder / "bounds").touch()
            return 10.0 * len(seen), 200.0 - len(seen)

        monkeypatch.setattr(bench, "_time_and_memory", told)
        figures = bench.measure_evaluation()
        assert list(figures.values()) == [10, 20, 30, 198]
        (first, compiled, empty), (folder, theirs, before), (again, _, after) = seen
        assert (compiled, theirs) == (str(first), None)
        assert (folder == again, empty, before, after) == (True, 0, 0, 1)
        assert not {own_cache, first} & {folder}
        assert not first.exists()
        assert not folder.exists()

    def test_one_that_fails_is_told(self):
        with pytest.raises(WorkerError, match="was to be measured ended unexpectedly"):
            bench._time_and_memory(["no.such.module"], {})
