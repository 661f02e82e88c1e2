"""Bounds of trials: those of the oracle, found once, kept on disk, whatever happens there."""

import numpy as np
import pytest
from oracle_calls import count_calls
from trial_bounds import draw, same

from kinarm.evaluation import bounds
from kinarm.evaluation.bounds import bounds_document, oracle_bounds
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.oracle import Oracle
from kinarm.scene import PAPER_BENCHES, Obstacle, Scene
from kinarm.task import RewardWeights

FAR = Obstacle(name="far", lower=(5.0, 5.0, 0.0), upper=(6.0, 6.0, 1.0))


@pytest.fixture(scope="module")
def hard() -> TrialSet:
    """Twelve trials, of which some are out of reach."""
    return draw("right", 12, 2, arm="paper_flange")


def forbid_solving(monkeypatch) -> None:
    def solve_batch(*_, **__):
        raise AssertionError("solved again")

    monkeypatch.setattr(Oracle, "solve_batch", solve_batch)


def test_bounds_are_those_of_the_oracle(folder, solutions):
    trials = draw()
    found = oracle_bounds(trials)
    assert same(found, solutions)


def test_the_reward_does_not_matter(folder, monkeypatch):
    oracle_bounds(draw())
    forbid_solving(monkeypatch)
    oracle_bounds(draw(reward=RewardWeights(success=4)))


@pytest.mark.parametrize(
    "other",
    [
        {"seed": 6},
        {"trials": 4},
        {"problem": "left"},
        {"arm": "paper_flange"},
        {"tolerance": 0.04},
        {"horizon": 65},
        {"start_spread": 0.5},
        {"scene": Scene(obstacles=(*PAPER_BENCHES, FAR))},
    ],
    ids=lambda other: next(iter(other)),
)
def test_other_trials_are_solved_and_kept_apart(folder, monkeypatch, other):
    oracle_bounds(draw())
    calls = count_calls(monkeypatch)
    trials = draw(**other)
    assert len(oracle_bounds(trials)) == len(trials)
    assert calls == [len(trials)]
    assert len(list(folder.glob("oracle-*"))) == 2


def test_another_version_of_the_oracle_solves_again(folder, monkeypatch):
    oracle_bounds(draw())
    calls = count_calls(monkeypatch)
    monkeypatch.setattr(bounds, "oracle_version", lambda: "later")
    oracle_bounds(draw())
    assert calls == [3]
    assert len(list(folder.glob("oracle-*"))) == 2


def test_progress_is_told_while_trials_are_solved(folder, monkeypatch):
    monkeypatch.setattr("kinarm.policies.oracle.oracle.LOT", 2)
    told = []
    trials = draw(trials=5)
    oracle_bounds(trials, lambda *counts: told.append(counts))
    assert told == [(2, 5), (4, 5), (5, 5)]
    oracle_bounds(trials, lambda *counts: told.append(counts))
    oracle_bounds(draw(trials=5), lambda *counts: told.append(counts))
    assert len(told) == 3


def test_document_sums_up_the_bounds(hard):
    solutions = oracle_bounds(hard)
    document = bounds_document(solutions).to_json()
    assert document["success"]["value"] == sum(solutions.reachable) / 12
    assert document["proof_complete_share"] == sum(solutions.proof_complete) / 12
    columns = {
        "steps": solutions.steps,
        "steps_lower_bound": solutions.steps_lower_bound,
        "gap": (solutions.steps - solutions.steps_lower_bound)[solutions.reachable],
    }
    for name, column in columns.items():
        assert document[name]["mean"] == pytest.approx(sum(column) / len(column))
        assert document[name]["median"] == np.median(column)
        assert document[name]["p95"] == np.percentile(column, 95)
        assert document[name]["max"] == max(column)


def test_document_says_why_trials_are_not_solved(hard):
    solutions = oracle_bounds(hard)
    document = bounds_document(solutions).to_json()
    unsolved = {entry["trial"]: entry["reason"] for entry in document["unsolved"]}
    assert list(unsolved) == [i for i in range(12) if not solutions.reachable[i]]
    assert 0 < len(unsolved) < 12
    proven = [trial for trial in unsolved if solutions.steps_lower_bound[trial] == 65]
    assert proven
    for trial, reason in unsolved.items():
        assert reason == solutions.reasons[trial]
        assert (reason == "out of reach: proven for all motions of 64 steps") == (trial in proven)


def test_document_of_hopeless_trials_has_no_gap(folder):
    document = bounds_document(oracle_bounds(draw(horizon=1))).to_json()
    assert (document["success"]["value"], document["gap"]) == (0, None)
    assert [entry["trial"] for entry in document["unsolved"]] == [0, 1, 2]
    assert document["steps"]["max"] == 1
    assert document["steps_lower_bound"]["mean"] == 2
