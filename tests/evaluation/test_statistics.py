"""Shares and intervals against formulas written out here."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from kinarm.evaluation import statistics
from kinarm.evaluation.statistics import (
    BOOTSTRAP_SEED,
    LEVEL,
    NUMBERS_AT_ONCE,
    RESAMPLES,
    Estimate,
    percentile_interval,
    resamples,
    wilson_interval,
)


def bootstrap_intervals(trials, figures):
    found = np.concatenate([figures(numbers) for numbers in resamples(trials)], axis=-1)
    return [percentile_interval(each) for each in found]


Z = 1.959963984540054
"""97.5 % quantile of the normal distribution."""


def wilson(hits: float, trials: int) -> tuple[float, float]:
    """Wilson (1927), equation for the score interval."""
    p = hits / trials
    centre = p + Z**2 / (2 * trials)
    half = Z * math.sqrt(p * (1 - p) / trials + Z**2 / (4 * trials**2))
    return (centre - half) / (1 + Z**2 / trials), (centre + half) / (1 + Z**2 / trials)


def share(hits: int, trials: int) -> Estimate:
    return Estimate.share(np.arange(trials) < hits)


@pytest.mark.parametrize(
    ("hits", "trials"), [(0, 1), (1, 1), (1, 2), (0, 200), (200, 200), (3, 7), (137, 200)]
)
def test_share_is_wilsons(hits, trials):
    result = share(hits, trials)
    assert result.value == hits / trials
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
    """Widened to whole hits of a seed."""
    for hits in range(0, 201, 7):
        low, high = wilson_interval(hits, 50, seeds=4)
        assert low == pytest.approx(wilson(hits // 4, 50)[0], abs=1e-12)
        assert high == pytest.approx(wilson(math.ceil(hits / 4), 50)[1], abs=1e-12)


def test_many_trials_are_resampled_piece_by_piece(monkeypatch):
    """Intervals do not depend on the pieces, and no piece is large."""
    values = np.random.default_rng(0).gamma(1.5, 0.1, 50)
    sizes = []

    def means(numbers):
        sizes.append(numbers.size)
        return values[numbers].mean(axis=-1)[None]

    whole = bootstrap_intervals(50, means)
    assert max(sizes) == 50 * RESAMPLES
    sizes.clear()
    monkeypatch.setattr(statistics, "NUMBERS_AT_ONCE", 700)
    assert bootstrap_intervals(50, means) == whole
    assert max(sizes) == 700


@pytest.mark.parametrize("trials", [2, 7, 401])
def test_intervals_are_those_of_scipy(trials):
    values = np.random.default_rng(trials).gamma(1.5, 0.1, trials)

    def figures(numbers):
        return np.stack([values[numbers].mean(axis=-1), np.median(values[numbers], axis=-1)])

    expected = stats.bootstrap(
        (np.arange(trials),),
        lambda resampled, axis: figures(resampled),
        n_resamples=RESAMPLES,
        confidence_level=LEVEL,
        method="percentile",
        rng=np.random.default_rng(BOOTSTRAP_SEED),
        batch=NUMBERS_AT_ONCE // trials,
    ).confidence_interval
    assert bootstrap_intervals(trials, figures) == list(zip(*map(tuple, expected), strict=True))
    for hits in range(trials + 1):
        wilson_of_scipy = stats.binomtest(hits, trials).proportion_ci(LEVEL, "wilson")
        assert share(hits, trials).ci95 == tuple(wilson_of_scipy)
