"""Intervals over seeds and trials, against SciPy's tests and simulated experiments."""

import math

import numpy as np
import pytest
from scipy import optimize, special, stats

from kinarm.evaluation.statistics import (
    Estimate,
    contrast,
    mean_share,
    share_difference,
    share_over_seeds,
    superiority,
)

RNG = np.random.default_rng


def mean_squares(values: np.ndarray) -> tuple[float, float, float]:
    """Of seeds, of trials and of the rest, in a two-way layout without repetition."""
    seeds, trials = values.shape
    rows, columns, mean = values.mean(axis=1), values.mean(axis=0), values.mean()
    rest = values - rows[:, None] - columns + mean
    return (
        trials * ((rows - mean) ** 2).sum() / (seeds - 1),
        seeds * ((columns - mean) ** 2).sum() / (trials - 1),
        (rest**2).sum() / (seeds - 1) / (trials - 1),
    )


def faced(rng, level, spread, ease) -> np.ndarray:
    """Hits of trials whose log odds are normal over seeds, and have an ease of their own."""
    return rng.random((len(spread), len(ease))) < special.expit(level + spread[:, None] + ease)


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

    def test_what_the_interaction_does_to_trials_counts_once(self):
        """Components of the variance by their definitions (Searle et al. 1992, 4.7)."""
        values = (
            RNG(11).normal(size=(5, 1)) + RNG(12).normal(size=30) + RNG(13).normal(size=(5, 30))
        )
        _, of_trials, noise = mean_squares(values)
        seeds = stats.sem(values.mean(axis=1)) * stats.t.ppf(0.975, 4)
        trials = math.sqrt((of_trials - noise) / 150) * stats.t.ppf(0.975, 29)
        low, high = contrast([(1.0, values)]).ci95
        assert (high - low) / 2 == pytest.approx(math.hypot(seeds, trials))

    def test_what_trials_share_cancels(self):
        hard = RNG(4).normal(size=40)
        ars, ppo = np.tile(hard + 1, (3, 1)), np.tile(hard, (3, 1))
        same = contrast([(1.0, ars), (-1.0, ppo)])
        assert same == Estimate(pytest.approx(1.0), pytest.approx((1.0, 1.0)))

    def test_a_single_seed_tells_nothing_of_others(self):
        assert contrast([(1.0, np.ones((1, 9)))]) == Estimate(1.0, None)
        assert contrast([(1.0, np.ones((9, 1)))]) == Estimate(1.0, None)

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
    @pytest.mark.parametrize("seeds", [2, 10])
    def test_seeds_that_all_hit_are_no_surer_than_one(self, seeds):
        for hits in (np.ones((seeds, 50)), np.zeros((seeds, 50))):
            np.testing.assert_allclose(
                share_over_seeds(hits).ci95, share_over_seeds(hits[:1]).ci95, atol=1e-8
            )

    @pytest.mark.parametrize("seeds", [2, 10])
    def test_equal_seeds_leave_the_interval_of_the_trials(self, seeds):
        one = RNG(14).random((1, 400)) < 0.9
        several, alone = share_over_seeds(np.tile(one, (seeds, 1))), share_over_seeds(one)
        np.testing.assert_allclose(several.ci95, alone.ci95, atol=1e-3)

    def test_two_seeds_are_about_both(self):
        """At 50 %, where the interval is nearly symmetric, by Student's with one degree."""
        hits = np.arange(1000) % 100 < np.array([[49], [51]])
        low, high = share_over_seeds(hits).ci95
        reach = 0.01 * stats.t.ppf(0.975, 1)
        np.testing.assert_allclose((low, high), (0.5 - reach, 0.5 + reach), atol=0.004)

    def test_a_few_misses_that_no_two_seeds_share_say_little(self):
        """A single miss leaves more doubt than as many independent trials would."""
        hits = np.ones((10, 200), bool)
        hits[0, 0] = False
        low, _ = share_over_seeds(hits).ci95
        independent = share_over_seeds(hits.reshape(1, -1)).ci95[0]
        assert share_over_seeds(hits[:1]).ci95[0] < low < independent

    @pytest.mark.parametrize("truth", [0.9, 0.97])
    @pytest.mark.parametrize(("spread", "ease"), [(0.5, 1.0), (0.5, 3.0), (0.0, 3.0)])
    def test_coverage_where_seeds_can_tell(self, truth, spread, ease):
        """Not too seldom, nor much too often: seeds and trials are normal in log odds."""
        rng, held = RNG(15), []
        many = rng.normal(size=200_000) * math.hypot(spread, ease)
        level = optimize.brentq(lambda m: special.expit(m + many).mean() - truth, 0, 40)
        for _ in range(400):
            hits = faced(rng, level, spread * rng.normal(size=10), ease * rng.normal(size=400))
            low, high = share_over_seeds(hits).ci95
            held.append(low <= truth <= high)
        assert 0.915 <= np.mean(held) <= 0.985

    def test_the_interval_of_none_and_of_all_is_no_point(self):
        none, everything = mean_share(np.zeros(4), 200), mean_share(np.ones(4), 200)
        assert none.ci95[0] == 0 < none.ci95[1] < 0.04
        assert 0.96 < everything.ci95[0] < everything.ci95[1] == 1

    def test_a_single_seed_has_no_mean_over_seeds(self):
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


class TestShareDifference:
    def test_against_itself(self):
        hits = RNG(16).random((4, 50)) < 0.5
        estimate = share_difference(hits, hits)
        assert estimate.value == 0
        assert estimate.ci95[0] == -estimate.ci95[1]

    def test_policies_that_agree_may_still_differ_elsewhere(self):
        low, high = share_difference(np.ones((1, 200)), np.ones((1, 200))).ci95
        assert -low == high == pytest.approx(math.sqrt(0.4) / 200 * stats.t.ppf(0.975, 199))

    def test_of_two_policies_is_paired(self):
        """As SciPy's test of paired values, but for two fifths of a trial."""
        first, second = RNG(17).random((2, 1, 300)) < [[[0.9]], [[0.8]]]
        paired = stats.ttest_rel(first[0].astype(float), second[0].astype(float))
        np.testing.assert_allclose(
            share_difference(first, second).ci95, paired.confidence_interval(), atol=1e-3
        )

    def test_stays_between_minus_one_and_one(self):
        always, never = np.ones((1, 3)), np.zeros((1, 3))
        assert share_difference(always, never).ci95[1] == 1
        assert share_difference(never, always).ci95[0] == -1
        assert share_difference(always[:, :1], never[:, :1]) == Estimate(1.0, None)

    @pytest.mark.parametrize("seeds", [(1, 1), (4, 4), (10, 1)])
    def test_coverage_in_simulated_experiments(self, seeds):
        """Half of what makes a trial easy is easy for both."""
        rng, held = RNG(18), []
        for _ in range(400):
            shared, *own = rng.normal(size=(3, 200))
            first, second = (
                faced(rng, 3, np.zeros(count), 2 * shared + each)
                for count, each in zip(seeds, own, strict=True)
            )
            low, high = share_difference(first, second).ci95
            held.append(low <= 0 <= high)
        assert 0.93 <= np.mean(held) <= 0.995


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
        np.testing.assert_allclose(superiority([below, below]).ci95, (0.05 ** (1 / 8), 1))

    def test_coverage_in_simulated_experiments(self):
        rng, hits = RNG(9), 0
        truth = stats.norm.cdf(1 / math.sqrt(2))
        for _ in range(400):
            pairs = [(rng.normal(size=(1, 4)), rng.normal(1, size=(1, 4))) for _ in range(3)]
            low, high = superiority(pairs).ci95
            hits += low < truth < high
        assert hits / 400 >= 0.95
