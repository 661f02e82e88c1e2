"""Outcomes of several seeds: resampled in order, and beside bounds of a part of the trials."""

from dataclasses import replace

import numpy as np
import pytest

from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.contestants import Contestant
from kinarm.evaluation.evaluation import evaluation_document, run_trials
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


def test_of_many_trials_the_first_are_bounded(skilled):
    trials = TrialSet.draw("right", 40, seed=8)
    few = TrialSet.draw("right", 12, seed=8)
    assert trials.first(12).digest == few.digest
    assert few.first(12) is few
    bounds, mine = oracle_bounds(few), Contestant.from_policy("skilled", skilled)
    many, first = (run_trials(mine, faced, bounds=bounds) for faced in (trials, few))
    for name in ("relative_success", "step_ratio", "step_ratio_p95"):
        assert many.metrics[name].value == first.metrics[name].value
    faced = evaluation_document([many], "").faced("right")
    assert faced.oracle.bounded == len(faced.oracle.trials.steps) == 12
    assert len(faced.starts) == 40
