"""Figures of merit against formulas written out here, and against a bootstrap written here."""

import math
from dataclasses import astuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from kinarm.episodes import Rollouts
from kinarm.evaluation.estimates import estimate_metrics
from kinarm.evaluation.outcomes import Outcomes
from kinarm.evaluation.statistics import Estimate

NAMES = {"mean": "mean_distance", "median": "median_distance", "iqm": "iqm_distance"}
NAMES["p95"] = "p95_distance"


def rollouts(distance: np.ndarray) -> Rollouts:
    """Episodes with these final distances; the rest does not matter."""
    none = np.zeros(len(distance))
    return Rollouts(
        starts=none,
        goals=none,
        success=distance <= 0.05,
        collision=none > 0,
        steps=none.astype(int),
        distance=distance,
        returns=-distance,
        configurations=none,
        targets=none,
        moments=none,
        paths=none,
    )


def figures_of(distances: np.ndarray) -> dict[str, Estimate]:
    """All figures of merit of one or several training seeds."""
    table = np.atleast_2d(distances)
    return estimate_metrics(Outcomes(tuple(rollouts(row) for row in table)))


def quantile(values: np.ndarray, p: float) -> float:
    """Linear interpolation between order statistics."""
    ordered = sorted(values)
    position = p * (len(ordered) - 1)
    below = math.floor(position)
    above = min(below + 1, len(ordered) - 1)
    return ordered[below] + (position - below) * (ordered[above] - ordered[below])


def interquartile_mean(values: np.ndarray) -> float:
    """Mean of what is left without the lowest and the highest quarter, rounded down."""
    cut = len(values) // 4
    kept = sorted(values)[cut : len(values) - cut]
    return sum(kept) / len(kept)


ESTIMATORS = {
    "mean": lambda values: sum(values) / len(values),
    "median": lambda values: quantile(values, 0.5),
    "iqm": interquartile_mean,
    "p95": lambda values: quantile(values, 0.95),
}


def own_bootstrap(table: np.ndarray, estimator, resamples: int = 2000) -> tuple[float, float]:
    """Percentile interval; the same resampled trials for every row."""
    rng = np.random.default_rng(987)
    trials = table.shape[1]
    estimates = [
        estimator(table[:, rng.integers(0, trials, trials)].ravel()) for _ in range(resamples)
    ]
    return quantile(estimates, 0.025), quantile(estimates, 0.975)


def skewed(n: int, seed: int = 0) -> np.ndarray:
    """Final distances as policies have them: many small, some large."""
    return np.random.default_rng(seed).gamma(1.5, 0.1, n)


def test_distance_figures_by_hand():
    figures = figures_of(np.array([0.8, 0.1, 0.4, 0.2, 0.3, 0.7, 0.6, 0.5]))
    assert figures["mean_distance"].value == pytest.approx(0.45)
    assert figures["median_distance"].value == pytest.approx(0.45)
    assert figures["iqm_distance"].value == pytest.approx((0.3 + 0.4 + 0.5 + 0.6) / 4)
    assert figures["p95_distance"].value == pytest.approx(0.7 + 0.65 * 0.1)
    assert figures["max_distance"].value == 0.8


@pytest.mark.parametrize("n", [1, 2, 3, 5, 6, 37, 200])
def test_distance_figures_are_the_formulas(n):
    values = skewed(n, seed=n)
    figures = figures_of(values)
    for name, estimator in ESTIMATORS.items():
        assert figures[NAMES[name]].value == pytest.approx(estimator(values), abs=1e-12), name
    assert figures["max_distance"].value == max(values)


BOOTSTRAPPED = [name for name in ESTIMATORS if name != "mean"]


@pytest.mark.parametrize("name", BOOTSTRAPPED)
def test_distance_intervals_are_those_of_a_bootstrap(name):
    table = skewed(200, seed=7)[None]
    interval = figures_of(table)[NAMES[name]].ci95
    expected = own_bootstrap(table, ESTIMATORS[name])
    np.testing.assert_allclose(interval, expected, atol=0.12 * (expected[1] - expected[0]))


@pytest.mark.parametrize("name", BOOTSTRAPPED)
def test_intervals_of_several_seeds_are_about_seeds_and_trials(name):
    """Student's reach over seeds, and over trials with the variance of a bootstrap."""
    table = skewed(800, seed=7).reshape(4, 200) + 0.1 * np.random.default_rng(1).random((4, 1))
    estimator, rng = ESTIMATORS[name], np.random.default_rng(3)
    of_seeds = stats.sem([estimator(row) for row in table]) * stats.t.ppf(0.975, 3)
    resamples = [estimator(table[:, rng.integers(0, 200, 200)].ravel()) for _ in range(2000)]
    reach = math.hypot(of_seeds, np.std(resamples, ddof=1) * stats.t.ppf(0.975, 199))
    value, (low, high) = astuple(figures_of(table)[NAMES[name]])
    assert value == pytest.approx(estimator(table.ravel()))
    np.testing.assert_allclose((low, high), (value - reach, value + reach), atol=0.1 * reach)


def test_interval_of_the_mean_is_students_with_the_farthest_trial_once_more():
    """Of several seeds that agree, too."""
    values = skewed(100, seed=2)
    more = np.append(values, values.max())
    expected = stats.ttest_1samp(more, 0).confidence_interval()
    for table in (values, np.stack([values] * 4)):
        np.testing.assert_allclose(figures_of(table)["mean_distance"].ci95, expected, rtol=1e-3)


def test_no_interval_of_several_seeds_is_below_zero():
    """Two seeds that differ much."""
    figures = figures_of(np.array([[0.01] * 9 + [0.02], [0.5] * 9 + [0.6]]))
    assert {figures[name].ci95[0] for name in NAMES.values()} == {0}


def test_few_failures_are_allowed_for():
    """Of 3 % of the trials; 50 of them have none in 22 % of all experiments."""
    truth = 0.97 * 0.035 + 0.03 * 0.35
    for trials, least in ((50, 0.7), (200, 0.92)):
        held = []
        for seed in range(150):
            rng = np.random.default_rng([seed, trials])
            near, far = rng.uniform(0.02, 0.05, trials), rng.uniform(0.1, 0.6, trials)
            far_away = np.where(rng.random(trials) < 0.03, far, near)
            low, high = figures_of(far_away)["mean_distance"].ci95
            held.append(low <= truth <= high)
        assert np.mean(held) >= least


def test_differences_are_of_every_figure_and_paired():
    """A policy that ends 1 cm nearer in each trial, whatever the trials."""
    values = np.stack([skewed(200)] * 3) + 0.2
    sides = [Outcomes(tuple(rollouts(row) for row in table)) for table in (values - 0.01, values)]
    found = estimate_metrics(*sides)
    for name in NAMES.values():
        low, high = found[name].ci95
        assert found[name].value == pytest.approx(-0.01)
        assert (low, high) == pytest.approx((-0.01, -0.01), abs=1e-9)
    assert found["success"].value == 0
    assert found["success"].ci95[0] == -found["success"].ci95[1] < 0


def test_intervals_of_several_seeds_cover_the_recipe_about_as_often_as_they_say():
    """Trainings differ, trials differ: the truth is the mean over both."""
    covered = 0
    for seed in range(150):
        rng = np.random.default_rng([seed, 5])
        easy, skill = rng.normal(0, 0.03, 60), rng.normal(0, 0.02, (5, 1))
        low, high = figures_of(0.3 + easy + skill)["mean_distance"].ci95
        covered += low <= 0.3 <= high
    assert 0.9 <= covered / 150 <= 1


def test_seeds_that_agree_are_no_further_evidence():
    values = skewed(100)
    one = figures_of(values)
    four = figures_of(np.stack([values] * 4))
    width = one["mean_distance"].ci95[1] - one["mean_distance"].ci95[0]
    assert four["mean_distance"].value == pytest.approx(one["mean_distance"].value)
    np.testing.assert_allclose(
        four["mean_distance"].ci95, one["mean_distance"].ci95, atol=0.12 * width
    )


def test_distance_interval_covers_the_truth_about_as_often_as_it_says():
    covered = {"mean": 0, "median": 0}
    truth = {"mean": 0.2, "median": 0.2 * math.log(2)}
    for seed in range(150):
        values = np.random.default_rng([seed, 31]).exponential(0.2, 100)
        figures = figures_of(values)
        for name in covered:
            low, high = figures[NAMES[name]].ci95
            covered[name] += low <= truth[name] <= high
    assert all(0.87 <= count / 150 <= 0.99 for count in covered.values()), covered


def test_a_single_trial_has_no_interval():
    for values in (np.array([0.3]), np.full((2, 1), 0.3)):
        figures = figures_of(values)
        assert {figures[name].ci95 for name in NAMES.values()} == {None}


def test_constant_trials_have_intervals_of_no_width():
    for values in (np.full(20, 0.3), np.zeros(3)):
        figures = figures_of(values)
        for low, high in (figures[name].ci95 for name in NAMES.values()):
            assert low == pytest.approx(values.flat[0], abs=1e-12)
            assert high == pytest.approx(values.flat[0], abs=1e-12)


distances = st.lists(st.floats(0, 2).map(lambda x: round(x, 6)), min_size=2, max_size=40)


@given(distances)
@settings(max_examples=40, deadline=None)
def test_intervals_hold_their_estimates_and_resampled_ones_lie_within_the_data(values):
    figures = figures_of(np.array(values))
    for name in NAMES.values():
        value, (low, high) = astuple(figures[name])
        assert low <= value + 1e-9, name
        assert value - 1e-9 <= high, name
        if name != NAMES["mean"]:
            assert min(values) - 1e-9 <= low <= high <= max(values) + 1e-9, name


@given(distances, st.data())
@settings(max_examples=40, deadline=None)
def test_no_figure_falls_when_a_trial_ends_farther_away(values, data):
    index = data.draw(st.integers(0, len(values) - 1))
    worse = np.array(values)
    worse[index] += data.draw(st.floats(0, 1))
    before, after = figures_of(np.array(values)), figures_of(worse)
    for name in (*NAMES.values(), "max_distance"):
        assert after[name].value >= before[name].value - 1e-12, name


@given(distances, st.randoms(use_true_random=False))
@settings(max_examples=30, deadline=None)
def test_the_order_of_trials_does_not_change_the_figures(values, random):
    shuffled = list(values)
    random.shuffle(shuffled)
    one, other = (figures_of(np.array(each)) for each in (values, shuffled))
    for name in (*NAMES.values(), "max_distance"):
        assert one[name].value == pytest.approx(other[name].value, abs=1e-12), name


@given(distances)
@settings(max_examples=30, deadline=None)
def test_twice_the_distance_is_twice_every_figure(values):
    one, twice = (figures_of(factor * np.array(values)) for factor in (1, 2))
    for name in NAMES.values():
        assert twice[name].value == 2 * one[name].value
        assert twice[name].ci95 == pytest.approx(tuple(2 * end for end in one[name].ci95))


def test_intervals_are_those_of_the_first_version():
    """Whatever makes them quicker leaves them as they were."""
    values = np.random.default_rng(3).gamma(1.5, 0.1, 50)
    one = figures_of(values)
    assert one["iqm_distance"].ci95 == (0.10184807239239957, 0.15768858526663912)
    assert one["median_distance"].ci95 == (0.0940768315668134, 0.15721044330135234)
    assert one["p95_distance"].ci95 == (0.24031129779337118, 0.49171388078802725)
