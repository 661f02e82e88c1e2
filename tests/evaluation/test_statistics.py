"""Figures of merit against formulas written out here, and against a bootstrap written here."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinarm.evaluation.statistics import DistanceStatistics, Share, performance_profile

Z = 1.959963984540054
"""97.5 % quantile of the normal distribution."""


def wilson(hits: float, trials: int) -> tuple[float, float]:
    """Wilson (1927), equation for the score interval."""
    p = hits / trials
    centre = p + Z**2 / (2 * trials)
    half = Z * math.sqrt(p * (1 - p) / trials + Z**2 / (4 * trials**2))
    return (centre - half) / (1 + Z**2 / trials), (centre + half) / (1 + Z**2 / trials)


def share(hits: int, trials: int) -> Share:
    return Share.of(np.arange(trials) < hits)


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


@pytest.mark.parametrize(
    ("hits", "trials"), [(0, 1), (1, 1), (1, 2), (0, 200), (200, 200), (3, 7), (137, 200)]
)
def test_share_is_wilsons(hits, trials):
    result = share(hits, trials)
    assert result.rate == hits / trials
    np.testing.assert_allclose(result.ci95, wilson(hits, trials), atol=1e-12)


def test_share_is_that_of_a_textbook():
    """Newcombe (1998), Table I: 81 of 263, score interval without continuity correction."""
    np.testing.assert_allclose(share(81, 263).ci95, (0.2553, 0.3662), atol=5e-5)


@given(st.integers(1, 300).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
@settings(max_examples=60, deadline=None)
def test_share_interval_holds_the_rate_and_stays_in_range(case):
    hits, trials = case
    low, high = share(hits, trials).ci95
    assert -1e-12 <= low <= hits / trials + 1e-12
    assert hits / trials - 1e-12 <= high <= 1 + 1e-12
    assert low < high


@given(st.integers(2, 120).flatmap(lambda n: st.tuples(st.integers(0, n - 1), st.just(n))))
@settings(max_examples=40, deadline=None)
def test_share_interval_rises_with_the_hits(case):
    hits, trials = case
    fewer, more = share(hits, trials), share(hits + 1, trials)
    assert fewer.ci95[0] < more.ci95[0]
    assert fewer.ci95[1] < more.ci95[1]


def test_certain_shares_are_certain_at_one_end_only():
    never, always = share(0, 50).ci95, share(50, 50).ci95
    assert never == pytest.approx((0, Z**2 / (50 + Z**2)), abs=1e-12)
    assert always == pytest.approx((50 / (50 + Z**2), 1), abs=1e-12)


@pytest.mark.parametrize("rate", [0.1, 0.5, 0.93])
def test_share_interval_covers_the_truth_as_often_as_it_says(rate):
    trials = 100
    hits = range(trials + 1)
    chance = [math.comb(trials, k) * rate**k * (1 - rate) ** (trials - k) for k in hits]
    covered = [share(k, trials).ci95[0] <= rate <= share(k, trials).ci95[1] for k in hits]
    assert 0.92 < np.dot(chance, covered) < 0.98


def test_pooled_share_is_no_surer_than_one_trial_set():
    rng = np.random.default_rng(4)
    for _ in range(30):
        hits = rng.random((4, 50)) < rng.random()
        pooled, expected = Share.of(hits), wilson(hits.sum() / 4, 50)
        assert pooled.rate == pytest.approx(hits.mean(), abs=1e-15)
        assert pooled.ci95[0] <= expected[0] + 1e-12
        assert pooled.ci95[1] >= expected[1] - 1e-12
        assert pooled.ci95[0] >= wilson(math.floor(hits.sum() / 4), 50)[0] - 1e-12
        assert pooled.ci95[1] <= wilson(math.ceil(hits.sum() / 4), 50)[1] + 1e-12


def test_pooled_share_of_equal_seeds_is_that_of_one():
    hits = np.arange(40) % 3 == 0
    assert Share.of(np.stack([hits] * 4)) == Share.of(hits)


@pytest.mark.parametrize("shape", [(40,), (3, 40)])
def test_profile_is_the_share_within_each_limit(shape):
    distances = np.random.default_rng(2).exponential(0.3, shape)
    limits = [0.0, 0.1, 0.3, float(distances.max())]
    profile = performance_profile(distances, limits)
    assert profile == tuple(Share.of(distances <= limit) for limit in limits)
    assert (profile[0].rate, profile[-1].rate) == (0, 1)
    for lower, upper in pairwise(profile):
        assert lower.rate <= upper.rate
        assert lower.ci95 <= upper.ci95


def test_share_as_json():
    assert share(1, 4).to_json() == {"rate": 0.25, "ci95": list(share(1, 4).ci95)}


def test_distance_figures_by_hand():
    figures = DistanceStatistics.of(np.array([0.8, 0.1, 0.4, 0.2, 0.3, 0.7, 0.6, 0.5]))
    assert figures.mean == pytest.approx(0.45)
    assert figures.median == pytest.approx(0.45)
    assert figures.iqm == pytest.approx((0.3 + 0.4 + 0.5 + 0.6) / 4)
    assert figures.p95 == pytest.approx(0.7 + 0.65 * 0.1)
    assert figures.max == 0.8


@pytest.mark.parametrize("n", [1, 2, 3, 5, 6, 37, 200])
def test_distance_figures_are_the_formulas(n):
    values = skewed(n, seed=n)
    figures = DistanceStatistics.of(values)
    for name, estimator in ESTIMATORS.items():
        assert getattr(figures, name) == pytest.approx(estimator(values), abs=1e-12), name
    assert figures.max == max(values)


@pytest.mark.parametrize("rows", [1, 3])
@pytest.mark.parametrize("name", ESTIMATORS)
def test_distance_intervals_are_those_of_a_bootstrap(name, rows):
    table = skewed(rows * 200, seed=7).reshape(rows, 200)
    interval = DistanceStatistics.of(table if rows > 1 else table[0]).ci95[name]
    expected = own_bootstrap(table, ESTIMATORS[name])
    np.testing.assert_allclose(interval, expected, atol=0.12 * (expected[1] - expected[0]))


def test_seeds_that_agree_are_no_further_evidence():
    values = skewed(100)
    one = DistanceStatistics.of(values)
    four = DistanceStatistics.of(np.stack([values] * 4))
    width = one.ci95["mean"][1] - one.ci95["mean"][0]
    assert four.mean == pytest.approx(one.mean)
    np.testing.assert_allclose(four.ci95["mean"], one.ci95["mean"], atol=0.12 * width)


def test_distance_interval_covers_the_truth_about_as_often_as_it_says():
    covered = {"mean": 0, "median": 0}
    truth = {"mean": 0.2, "median": 0.2 * math.log(2)}
    for seed in range(150):
        values = np.random.default_rng([seed, 31]).exponential(0.2, 100)
        intervals = DistanceStatistics.of(values).ci95
        for name in covered:
            covered[name] += intervals[name][0] <= truth[name] <= intervals[name][1]
    assert all(0.87 <= count / 150 <= 0.99 for count in covered.values()), covered


def test_figures_are_reproducible():
    assert DistanceStatistics.of(skewed(30)) == DistanceStatistics.of(skewed(30))


def test_a_single_trial_has_no_interval():
    for values in (np.array([0.3]), np.full((2, 1), 0.3)):
        figures = DistanceStatistics.of(values)
        assert set(figures.ci95.values()) == {None}
        assert set(figures.to_json()["ci95"].values()) == {None}


def test_constant_trials_have_intervals_of_no_width():
    for values in (np.full(20, 0.3), np.zeros(3)):
        figures = DistanceStatistics.of(values)
        for low, high in figures.ci95.values():
            assert low == pytest.approx(values.flat[0], abs=1e-12)
            assert high == pytest.approx(values.flat[0], abs=1e-12)


def test_distance_as_json():
    figures = DistanceStatistics.of(skewed(10))
    document = figures.to_json()
    assert set(document) == {"mean", "median", "iqm", "p95", "max", "ci95"}
    assert set(document["ci95"]) == {"mean", "median", "iqm", "p95"}
    assert document["ci95"]["iqm"] == list(figures.ci95["iqm"])


distances = st.lists(st.floats(0, 2).map(lambda x: round(x, 6)), min_size=2, max_size=40)


@given(distances)
@settings(max_examples=40, deadline=None)
def test_intervals_hold_their_estimates_and_lie_within_the_data(values):
    figures = DistanceStatistics.of(np.array(values))
    for name, (low, high) in figures.ci95.items():
        assert min(values) - 1e-9 <= low <= getattr(figures, name) + 1e-9, name
        assert getattr(figures, name) - 1e-9 <= high <= max(values) + 1e-9, name


@given(distances, st.data())
@settings(max_examples=40, deadline=None)
def test_no_figure_falls_when_a_trial_ends_farther_away(values, data):
    index = data.draw(st.integers(0, len(values) - 1))
    worse = np.array(values)
    worse[index] += data.draw(st.floats(0, 1))
    before, after = DistanceStatistics.of(np.array(values)), DistanceStatistics.of(worse)
    for name in (*ESTIMATORS, "max"):
        assert getattr(after, name) >= getattr(before, name) - 1e-12, name


@given(distances, st.randoms(use_true_random=False))
@settings(max_examples=30, deadline=None)
def test_the_order_of_trials_does_not_change_the_figures(values, random):
    shuffled = list(values)
    random.shuffle(shuffled)
    one, other = (DistanceStatistics.of(np.array(each)) for each in (values, shuffled))
    for name in (*ESTIMATORS, "max"):
        assert getattr(one, name) == pytest.approx(getattr(other, name), abs=1e-12), name


@given(distances)
@settings(max_examples=30, deadline=None)
def test_twice_the_distance_is_twice_every_figure(values):
    one, twice = (DistanceStatistics.of(factor * np.array(values)) for factor in (1, 2))
    for name, interval in one.ci95.items():
        assert getattr(twice, name) == 2 * getattr(one, name)
        assert twice.ci95[name] == tuple(2 * end for end in interval)
