"""Outcomes of several seeds: resampled in order, and beside bounds of a part of the trials."""

from dataclasses import replace

import numpy as np
import pytest

from kinarm.evaluation import bounds
from kinarm.evaluation.bounds import bounded_trials, first_bounds, oracle_bounds
from kinarm.evaluation.contestants import Contestant
from kinarm.evaluation.document import evaluation_document
from kinarm.evaluation.evaluation import run_trials
from kinarm.evaluation.outcomes import Outcomes
from kinarm.evaluation.trials import TrialSet


@pytest.mark.parametrize("shape", [(9,), (4, 9), (1, 9)])
@pytest.mark.parametrize("seeds", [1, 3])
def test_resampled_distances_in_order_are_those_that_are_sorted(skilled_evaluation, seeds, shape):
    rng = np.random.default_rng(0)
    rollouts = tuple(
        replace(skilled_evaluation.rollouts, distance=rng.random(9).round(1)) for _ in range(seeds)
    )
    resampled = Outcomes(rollouts).resampled(rng.integers(9, size=shape))
    assert resampled.distance.shape == (*shape[:-1], 9 * seeds)
    np.testing.assert_array_equal(resampled.ordered_distance, np.sort(resampled.distance, axis=-1))


def test_distances_are_put_in_order_once(skilled_evaluation):
    outcomes = Outcomes((skilled_evaluation.rollouts,))
    order, ordered = outcomes.order_of("distance")
    np.testing.assert_array_equal(outcomes.distance[..., order].ravel(), ordered.ravel())
    assert outcomes.order_of("distance")[0] is order


@pytest.fixture
def few_bounded(monkeypatch):
    monkeypatch.setattr(bounds, "MOST_BOUNDED", 12)


@pytest.mark.usefixtures("few_bounded")
def test_of_many_trials_the_first_are_bounded(skilled):
    trials = TrialSet.draw("right", 40, seed=8)
    few = TrialSet.draw("right", 12, seed=8)
    assert bounded_trials(trials).digest == few.digest
    assert bounded_trials(few) is few
    many = run_trials(Contestant.from_policy("skilled", skilled), trials, oracle=True)
    first = run_trials(Contestant.from_policy("skilled", skilled), few, oracle=True)
    assert len(many.bounds) == 12
    for name in ("relative_success", "step_ratio", "step_ratio_p95"):
        assert many.metrics[name].value == first.metrics[name].value
    entry = evaluation_document([many], "")["protocol"]["problems"]["right"]
    assert entry["oracle"]["bounded"] == len(entry["oracle"]["trials"]["steps"]) == 12
    assert len(entry["starts"]) == 40


@pytest.mark.usefixtures("few_bounded")
def test_bounds_of_all_trials_serve_where_they_are_known():
    trials = TrialSet.draw("right", 14, seed=9)
    known = oracle_bounds(trials)
    assert first_bounds(trials) is known
