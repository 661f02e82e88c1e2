"""Shares and intervals of one policy, against SciPy and a textbook."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import optimize, stats

from kinarm.evaluation import estimates
from kinarm.evaluation.estimates import (
    BOOTSTRAP_SEED,
    NUMBERS_AT_ONCE,
    RESAMPLES,
    percentile_interval,
    resamples,
)
from kinarm.evaluation.statistics import LEVEL, Estimate


def bootstrap_intervals(trials, figures):
    found = np.concatenate([figures(numbers) for numbers in resamples(trials)], axis=-1)
    return [percentile_interval(each) for each in found]


def mid_p(hits: float, trials: int) -> tuple[float, float]:
    """Where what was seen, counted half, and what is rarer have a chance of 2.5 % (SciPy)."""

    def tail(rate: float, hits: int) -> float:
        return stats.binom.sf(hits, trials, rate) + stats.binom.pmf(hits, trials, rate) / 2 - 0.025

    low = optimize.brentq(tail, 0, 1, (hits,), xtol=1e-14) if hits else 0
    return low, 1 - optimize.brentq(tail, 0, 1, (trials - hits,)) if hits < trials else 1


def share(hits: int, trials: int) -> Estimate:
    return Estimate.share(np.arange(trials) < hits)


@pytest.mark.parametrize(
    ("hits", "trials"), [(0, 1), (1, 1), (1, 2), (0, 200), (200, 200), (3, 7), (137, 200)]
)
def test_share_is_mid_p(hits, trials):
    result = share(hits, trials)
    assert result.value == hits / trials
    np.testing.assert_allclose(result.ci95, mid_p(hits, trials), atol=1e-8)


@pytest.mark.parametrize(
    ("hits", "trials", "low", "high"),
    [
        (81, 263, 0.2544, 0.3658),
        (15, 148, 0.0601, 0.1581),
        (0, 20, 0, 0.1391),
        (1, 29, 0.0017, 0.1585),
    ],
)
def test_share_is_that_of_a_textbook(hits, trials, low, high):
    """Newcombe (1998), Table I."""
    np.testing.assert_allclose(share(hits, trials).ci95, (low, high), atol=6e-5)


@given(st.integers(1, 300).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
@settings(max_examples=60, deadline=None)
def test_share_interval_holds_the_rate_and_stays_in_range(case):
    hits, trials = case
    low, high = share(hits, trials).ci95
    assert 0 <= low <= hits / trials <= high <= 1
    assert low < high


@given(st.integers(2, 120).flatmap(lambda n: st.tuples(st.integers(0, n - 1), st.just(n))))
@settings(max_examples=40, deadline=None)
def test_share_interval_rises_with_the_hits(case):
    hits, trials = case
    fewer, more = share(hits, trials), share(hits + 1, trials)
    assert fewer.ci95[0] < more.ci95[0]
    assert fewer.ci95[1] < more.ci95[1]


@pytest.mark.parametrize("trials", [50, 200, 1000])
def test_share_interval_covers_the_truth_as_often_as_it_says(trials):
    """Near 100 %, where Wilson's covers 84 to 92 % of the time, too."""
    found = np.array([share(hits, trials).ci95 for hits in range(trials + 1)])
    rates = np.linspace(0.5, 1 - 0.1 / trials, 200)
    held = (found[:, :1] <= rates) & (rates <= found[:, 1:])
    chances = stats.binom.pmf(np.arange(trials + 1)[:, None], trials, rates)
    covered = (chances * held).sum(axis=0)
    assert covered.min() > 0.92
    assert 0.945 < covered.mean() < 0.965


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
    monkeypatch.setattr(estimates, "NUMBERS_AT_ONCE", 700)
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
