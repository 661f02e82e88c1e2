"""Shares, means, differences and contrasts with their 95 % intervals.

`docs/measurements/intervals.py` simulates how often they cover the truth.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

LEVEL = 0.95

DEVIATIONS = 1.959963984540054
"""Standard deviations that enclose this share of a normal distribution."""

UNSEEN = 0.2
"""Trials that might have gone otherwise for all seeds alike, beside those that were seen."""

HALVINGS = 30
"""Steps of bisection to the end of an interval."""

Interval = tuple[float, float]


@dataclass(frozen=True)
class Estimate:
    """A figure of merit with its interval.

    Parameters
    ----------
    value : float, optional
        The figure; None if unknown.
    ci95 : tuple of float, optional
        Its 95 % interval, if any.
    """

    value: float | None
    ci95: Interval | None = None

    @classmethod
    def share(cls, hits: NDArray[np.bool_]) -> "Estimate":
        """Share of trials that hit, with its mid-P interval; shape (n_trials,)."""
        return share_over_seeds(hits[None])

    def __str__(self) -> str:
        interval = " ({:.3f}..{:.3f})".format(*self.ci95) if self.ci95 else ""
        return "not measurable" if self.value is None else f"{self.value:.3f}{interval}"

    def to_json(self) -> dict[str, Any]:
        """As a dictionary that JSON can hold."""
        return {"value": self.value, "ci95": self.ci95 and list(self.ci95)}


Terms = Sequence[tuple[float, NDArray[Any]]]
"""Weights, and values of shape (n_seeds, n_trials)."""


def contrast(terms: Terms) -> Estimate:
    """Weighted sum of means over seeds and trials; no interval where a term has one seed.

    Seeds and trials are crossed random effects: all seeds, and perhaps several recipes and tasks,
    face the same trials.
    """
    value = _weighted_mean(terms)
    if any(min(values.shape) < 2 for _, values in terms):
        return Estimate(value)
    reach = math.sqrt(_crossed_reach(terms))
    return Estimate(value, (value - reach, value + reach))


def mean_interval(*sides: NDArray[np.float64]) -> Interval | None:
    """95 % interval of a mean over seeds and trials, or of one less another.

    As in `contrast`, but that a single seed stands for itself, and that the farthest trial of each
    side counts once more: few trials seldom have seen the worst. Shape (n_seeds, n_trials) each.
    """
    trials = sides[0].shape[1]
    if trials == 1:
        return None
    farthest = [int(values.mean(axis=0).argmax()) for values in sides]
    faced = [*range(trials), *farthest]
    terms = [(weight, values[:, faced]) for weight, values in zip((1.0, -1.0), sides, strict=False)]
    middle, reach = _weighted_mean(terms), math.sqrt(_crossed_reach(terms))
    return middle - reach, middle + reach


def share_difference(first: NDArray[Any], second: NDArray[Any]) -> Estimate:
    """Difference of two shares of the same trials, and its 95 % interval.

    As in `contrast`, but that `UNSEEN` more trials are allowed for where the one alone hits, and
    as many for the other. A single seed stands for itself: the interval is then about other trials
    alone. Hits have shape (n_seeds, n_trials).
    """
    terms, trials = ((1.0, first), (-1.0, second)), first.shape[1]
    value = _weighted_mean(terms)
    if trials == 1:
        return Estimate(value)
    unseen = 2 * UNSEEN * (student(trials) / trials) ** 2
    reach = math.sqrt(_crossed_reach(terms) + unseen)
    return Estimate(value, (max(value - reach, -1.0), min(value + reach, 1.0)))


def _weighted_mean(terms: Terms) -> float:
    return sum(weight * float(values.mean()) for weight, values in terms)


def _crossed_reach(terms: Terms) -> float:
    """Square of the half width of an interval over seeds and trials.

    It is that of Student's interval for the seeds, and for the trials with their own degrees of
    freedom (Banerjee 1960). Either contains the interaction of seed and trial; that of the trials
    is taken without it.
    """
    of_trials = np.sum([weight * values.mean(axis=0) for weight, values in terms], axis=0)
    of_seeds, noise = [], 0.0
    for weight, values in terms:
        seeds, trials = values.shape
        if seeds > 1:
            each = values.mean(axis=1)
            of_seeds.append(weight * each)
            rest = values - each[:, None] - values.mean(axis=0) + values.mean()
            noise += weight * weight * float((rest**2).sum()) / (seeds * (seeds - 1) * (trials - 1))
    beyond = squared_reach(of_trials) - student(len(of_trials)) ** 2 * noise / len(of_trials)
    return float(np.maximum(beyond, 0) + (squared_reach(*of_seeds) if of_seeds else 0))


def squared_reach(*samples: NDArray[np.float64]) -> NDArray[np.float64]:
    """Square of half of Student's interval for a sum of means of independent values.

    Samples have shape (n, ...); degrees of freedom are those of Welch and Satterthwaite.
    """
    from scipy.special import stdtrit

    variances = [values.var(axis=0, ddof=1) / len(values) for values in samples]
    total = np.sum(variances, axis=0)
    spread = sum(
        each**2 / (len(values) - 1) for each, values in zip(variances, samples, strict=True)
    )
    freedom = np.divide(total**2, spread, out=np.ones_like(total), where=spread > 0)
    square: NDArray[np.float64] = stdtrit(freedom, (1 + LEVEL) / 2) ** 2 * total
    return square


@lru_cache(maxsize=32)
def student(count: int) -> float:
    """Standard errors that Student's interval of a mean of ``count`` values reaches."""
    from scipy.special import stdtrit

    return float(stdtrit(count - 1, (1 + LEVEL) / 2))


def share_over_seeds(hits: NDArray[Any]) -> Estimate:
    """A share of trials and its 95 % interval.

    Hits, shape (n_seeds, n_trials), may be shares of several trainings as well. The interval of
    one seed is the mid-P one; that of several as well, of as many independent trials as would have
    the variance over seeds and trials (see `contrast`).
    """
    share, (seeds, trials) = float(hits.mean()), hits.shape
    if min(seeds, trials) == 1:
        return Estimate(share, _mid_p(share, trials))
    return Estimate(share, _share_interval(share, _crossed_reach([(1.0, hits)]), seeds, trials))


def mean_share(shares: NDArray[np.float64], n_trials: int) -> Estimate:
    """Mean of the seeds' shares of trials that are not known one by one.

    The ``n_trials`` count as if all seeds had met the same ones.
    """
    share = float(shares.mean())
    if len(shares) == 1:
        return Estimate(share)
    binomial = DEVIATIONS**2 * share * (1 - share) / n_trials
    square = float(squared_reach(shares)) + binomial
    return Estimate(share, _share_interval(share, square, len(shares), n_trials))


def _share_interval(share: float, square: float, seeds: int, trials: int) -> Interval:
    """Interval of a share from the square of its reach.

    The reach tells how many trials count as one. Few hits, or few misses, cannot tell whether
    seeds share them: `UNSEEN` trials of one seed are added that all of them do.
    """
    rare, often = min(share, 1 - share) * trials, max(share, 1 - share)
    alike = square / DEVIATIONS**2 * seeds * trials**2 / often
    effect = (alike + UNSEEN * seeds) / (rare + UNSEEN)
    return _mid_p(share, seeds * trials / max(effect, 1.0))


@lru_cache(maxsize=1024)
def _mid_p(share: float, trials: float) -> Interval:
    """Mid-P interval of a share of independent trials (Lancaster 1961).

    It is the exact one of Clopper and Pearson, but that what was seen counts half in either tail.
    Trials may be a fraction.
    """
    from scipy.special import betainc

    def least(hits: float, misses: float) -> float:
        low, high = 0.0, 1.0
        for _ in range(HALVINGS if hits > 0 else 0):
            middle = (low + high) / 2
            tails = betainc(hits, misses + 1, middle)
            tails += betainc(hits + 1, misses, middle) if misses > 0 else 0.0
            low, high = (middle, high) if tails < 1 - LEVEL else (low, middle)
        return low

    hits, misses = share * trials, (1 - share) * trials
    return least(hits, misses), 1 - least(misses, hits)


def superiority(pairs: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]]) -> Estimate:
    """Probability that a member of the first group is below one of the second; ties count half.

    Measures of the same groups, and then pairs of groups, are averaged. The interval is the mid-P
    one, for as many independent comparisons as the smaller groups have members: the variance of
    the statistic is at most theirs (van Dantzig 1951). Groups have shape (n_measures, n_seeds);
    infinity stands for never.
    """
    below = [
        (first[:, :, None] < second[:, None]) + 0.5 * (first[:, :, None] == second[:, None])
        for first, second in pairs
    ]
    value = float(np.mean([comparisons.mean() for comparisons in below]))
    n = sum(min(first.shape[1], second.shape[1]) for first, second in pairs)
    return Estimate(value, _mid_p(value, n))
