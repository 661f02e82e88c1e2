"""Intervals over seeds and trials, against SciPy's tests and simulated experiments."""

import math

import numpy as np
import pytest
from scipy import stats

from kinarm.evaluation.statistics import (
    Estimate,
    contrast,
    estimate_text,
    mean_share,
    superiority,
)

RNG = np.random.default_rng


class TestContrast:
    def test_equal_seeds_leave_the_interval_of_the_trials(self):
        trials = RNG(0).normal(size=30)
        estimate = contrast([(1.0, np.tile(trials, (4, 1)))])
        expected = stats.ttest_1samp(trials, 0).confidence_interval()
        assert estimate.value == pytest.approx(trials.mean())
        np.testing.assert_allclose(estimate.ci95, expected)

    def test_equal_trials_leave_the_interval_of_the_seeds(self):
        seeds = RNG(1).normal(size=4)
        estimate = contrast([(1.0, np.tile(seeds[:, None], 50))])
        np.testing.assert_allclose(estimate.ci95, stats.ttest_1samp(seeds, 0).confidence_interval())

    def test_two_groups_of_seeds_are_compared_as_welch_does(self):
        one, other = RNG(2).normal(size=4), RNG(3).normal(1, 3, size=6)
        terms = [
            (1.0, np.tile(one[:, None], 50)),
            (-1.0, np.tile(other[:, None], 50)),
        ]
        welch = stats.ttest_ind(one, other, equal_var=False).confidence_interval()
        np.testing.assert_allclose(contrast(terms).ci95, welch)

    def test_what_trials_share_cancels(self):
        hard = RNG(4).normal(size=40)
        ars, ppo = np.tile(hard + 1, (3, 1)), np.tile(hard, (3, 1))
        same = contrast([(1.0, ars), (-1.0, ppo)])
        assert same == Estimate(pytest.approx(1.0), pytest.approx((1.0, 1.0)))

    def test_a_single_seed_tells_nothing_of_others(self):
        assert contrast([(1.0, np.ones((1, 9)))]) == Estimate(1.0, None)

    def test_coverage_in_simulated_experiments(self):
        rng, hits = RNG(5), 0
        for _ in range(400):
            values = rng.normal(size=(4, 1)) + 2 * rng.normal(size=(1, 25))
            low, high = contrast([(1.0, values + rng.normal(size=(4, 25)))]).ci95
            hits += low < 0 < high
        assert hits / 400 >= 0.93

    @pytest.mark.parametrize(
        "weights",
        [(1.0, -0.5, -0.5), (0.5, 0.5, -0.5, -0.5), (1.0, -1.0)],
        ids=["both less left and right", "ARS less PPO on two tasks", "ARS less PPO on one"],
    )
    def test_coverage_where_trials_are_crossed(self, weights):
        """A start that is hard is hard on every task, and for the first learner most of all."""
        rng, hits = RNG(10), 0
        for _ in range(400):
            hard = rng.normal(size=(1, 40))
            terms = [
                (weight, rng.normal(size=(4, 1)) / 4 + (1 + (weight > 0)) * hard + noise)
                for weight in weights
                for noise in [rng.normal(size=(4, 40)) / 2]
            ]
            low, high = contrast(terms).ci95
            hits += low < 0 < high
        assert hits / 400 >= 0.93


class TestShare:
    def test_the_interval_of_none_and_of_all_is_no_point(self):
        none, everything = mean_share(np.zeros(4), 200), mean_share(np.ones(4), 200)
        assert none.ci95[0] == 0 < none.ci95[1] < 0.04
        assert 0.96 < everything.ci95[0] < everything.ci95[1] == 1

    def test_a_single_seed_has_no_interval(self):
        assert mean_share(np.array([0.5]), 200) == Estimate(0.5, None)

    @pytest.mark.parametrize("rate", [0.1, 0.5])
    def test_coverage_in_simulated_experiments(self, rate):
        rng, hits = RNG(6), 0
        for _ in range(400):
            chances = np.clip(rate + rng.normal(0, 0.05, size=(4, 1)), 0, 1)
            difficulty = rng.uniform(size=(1, 100))
            low, high = mean_share((difficulty < chances).mean(axis=1), 100).ci95
            hits += low < rate < high
        assert hits / 400 >= 0.93


class TestSuperiority:
    def test_against_mann_and_whitney(self):
        one, other = RNG(7).normal(size=5), RNG(8).normal(0.5, size=7)
        u = stats.mannwhitneyu(one, other).statistic
        assert superiority([(one[None], other[None])]).value == pytest.approx(1 - u / 35)

    def test_ties_count_half_and_never_is_last(self):
        one, other = np.array([[1.0, math.inf]]), np.array([[1.0, math.inf]])
        assert superiority([(one, other)]).value == 0.5
        always = superiority([(np.array([[1.0, 2.0]]), np.array([[math.inf, 3.0]]))])
        assert always.value == 1

    def test_interval_is_that_of_as_many_comparisons_as_the_smaller_groups_have_members(self):
        below = (np.zeros((3, 4)), np.ones((3, 5)))
        wilson = stats.binomtest(8, 8).proportion_ci(method="wilson")
        np.testing.assert_allclose(superiority([below, below]).ci95, (wilson.low, wilson.high))

    def test_coverage_in_simulated_experiments(self):
        rng, hits = RNG(9), 0
        truth = stats.norm.cdf(1 / math.sqrt(2))
        for _ in range(400):
            pairs = [(rng.normal(size=(1, 4)), rng.normal(1, size=(1, 4))) for _ in range(3)]
            low, high = superiority(pairs).ci95
            hits += low < truth < high
        assert hits / 400 >= 0.95


def test_estimates_in_words():
    assert estimate_text(Estimate(0.5, (0.25, 0.75))) == "0.500 (0.250..0.750)"
    assert estimate_text(Estimate(0.5)) == "0.500 (no interval)"
    assert estimate_text(Estimate(None)) == "not measurable"
