"""Figures of merit and contrasts with their 95 % intervals.

They are written out, because SciPy's take longer to load than a policy to evaluate.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.metrics import METRICS, Metric
from kinarm.evaluation.outcomes import Outcomes

LEVEL = 0.95
RESAMPLES = 1000
BOOTSTRAP_SEED = 0

DEVIATIONS = 1.959963984540054
"""Standard deviations that enclose this share of a normal distribution."""

NUMBERS_AT_ONCE = 400_000
"""Trial numbers that are resampled at once, which limits the memory."""

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
        """Share of trials that hit, with its Wilson interval; shape (n_trials,)."""
        return cls(float(hits.mean()), wilson_interval(int(hits.sum()), len(hits)))

    def __str__(self) -> str:
        interval = " ({:.3g}..{:.3g})".format(*self.ci95) if self.ci95 else ""
        return "unknown" if self.value is None else f"{self.value:.3g}{interval}"

    def to_json(self) -> dict[str, Any]:
        """As a dictionary that JSON can hold."""
        return {"value": self.value, "ci95": self.ci95 and list(self.ci95)}


def estimate_metrics(outcomes: Outcomes) -> dict[str, Estimate]:
    """Compute all `METRICS` with intervals; unknown figures stay empty.

    Intervals are about other trials, and with several training seeds also about other trainings.
    """
    known = {
        name: metric
        for name, metric in METRICS.items()
        if (outcomes.bounds is not None or not metric.needs_bounds)
        and (outcomes.holding or not metric.needs_holding)
    }
    intervals = _bootstrapped(outcomes, known) | _of_shares(outcomes, known)
    estimates = dict.fromkeys(METRICS, Estimate(None))
    for name, metric in known.items():
        value = metric.formula(outcomes)
        if value is not None and not np.isnan(value):
            estimates[name] = Estimate(float(value), intervals.get(name))
    return estimates


def _of_shares(outcomes: Outcomes, known: Mapping[str, Metric]) -> dict[str, Interval | None]:
    """Intervals of the metrics that are shares of trials."""
    each = np.arange(len(outcomes.rollouts[0].success))[:, None]
    seeds = [outcomes.of_seed(seed).resampled(each) for seed in range(len(outcomes.rollouts))]
    return {
        name: share_over_seeds(np.array([metric.formula(seed) for seed in seeds])).ci95
        for name, metric in known.items()
        if metric.interval == "Wilson"
    }


def _bootstrapped(outcomes: Outcomes, known: Mapping[str, Metric]) -> dict[str, Interval | None]:
    """Intervals of other metrics, from resamples of the trials.

    With several training seeds, the variance over the seeds is added to that over the trials, as
    in `contrast`.
    """
    formulas = {name: each.formula for name, each in known.items() if each.interval == "bootstrap"}

    def figures(some: Outcomes) -> NDArray[np.float64]:
        return np.stack([formula(some) for formula in formulas.values()])

    trials, seeds = len(outcomes.rollouts[0].success), len(outcomes.rollouts)
    if trials == 1:
        return dict.fromkeys(formulas)
    pieces = [figures(outcomes.resampled(numbers)) for numbers in resamples(trials)]
    found = np.concatenate(pieces, axis=-1)
    if seeds == 1:
        return dict(zip(formulas, map(percentile_interval, found), strict=True))
    each = np.stack([figures(outcomes.of_seed(seed)) for seed in range(seeds)], axis=-1)
    intervals: dict[str, Interval | None] = {}
    for name, of_seeds, of_trials in zip(formulas, each, found, strict=True):
        value = float(formulas[name](outcomes))
        parts = [(of_seeds.var(ddof=1) / seeds, seeds - 1), (of_trials.var(ddof=1), trials - 1)]
        low, high = student(value, parts).ci95 or (value, value)
        intervals[name] = (max(low, 0.0) if known[name].unit == "m" else low, high)
    return intervals


def wilson_interval(hits: int, trials: int, seeds: int = 1) -> Interval:
    """95 % interval of a share of trials (Wilson 1927); exact where none or all hit.

    Parameters
    ----------
    hits, trials : int
        Hits of all seeds together, and the trials that every seed faced.
    seeds : int
        Number of training seeds. They face the same trials and are no
        independent evidence: the interval is that of the trials of one, widened
        to whole hits.
    """

    def end(hits: int, side: int) -> float:
        share, z = hits / trials, DEVIATIONS
        spread = 2 * (trials + z**2)
        centre = (2 * trials * share + z**2) / spread
        return centre + side * (z / spread * math.sqrt(4 * trials * share * (1 - share) + z**2))

    few, many = hits // seeds, -(-hits // seeds)
    return end(few, -1) if few > 0 else 0.0, end(many, 1) if many < trials else 1.0


def percentile_interval(figures: NDArray[np.float64]) -> Interval:
    """Ends of the middle 95 % of figures, shape (n_resamples,)."""
    ordered, tail = np.sort(figures), (1 - LEVEL) / 2
    return _quantile(ordered, tail), _quantile(ordered, 1 - tail)


def resamples(trials: int) -> Iterable[NDArray[np.int64]]:
    """Trial numbers of all resamples, in pieces of shape (n, trials); seeded."""
    return _kept(trials) if RESAMPLES * trials <= NUMBERS_AT_ONCE else _drawn(trials)


@lru_cache(maxsize=1)
def _kept(trials: int) -> tuple[NDArray[np.int64], ...]:
    """A single piece, kept for the next policy with as many trials."""
    return tuple(_drawn(trials))


def _drawn(trials: int) -> Iterator[NDArray[np.int64]]:
    rng, at_once = np.random.default_rng(BOOTSTRAP_SEED), max(1, NUMBERS_AT_ONCE // trials)
    for done in range(0, RESAMPLES, at_once):
        yield rng.integers(trials, size=(min(at_once, RESAMPLES - done), trials))


def _quantile(ordered: NDArray[np.float64], share: float) -> float:
    """Quantile, interpolated linearly."""
    rank = share * len(ordered) + (1 - share)
    below, beyond = int(rank) - 1, rank % 1
    return float((1 - beyond) * ordered[below] + beyond * ordered[below + 1])


def estimate_text(estimate: Estimate) -> str:
    """A statistic and its interval in words."""
    if estimate.value is None:
        return "not measurable"
    interval = "{:.3f}..{:.3f}".format(*estimate.ci95) if estimate.ci95 else "no interval"
    return f"{estimate.value:.3f} ({interval})"


def contrast(terms: Sequence[tuple[float, NDArray[np.float64]]]) -> Estimate:
    """Weighted sum of means over seeds and trials: of weights, and values (n_seeds, n_trials).

    Seeds and trials are crossed random effects: all seeds, and perhaps several recipes and tasks,
    face the same trials. The variance is that of the seeds' means, in each term, plus that of the
    trials' weighted means. Both contain the interaction of seed and trial, so the interval is
    rather too wide. It is Student's, with the degrees of freedom of Welch and Satterthwaite.
    """
    value = sum(weight * float(values.mean()) for weight, values in terms)
    parts = [
        (weight**2 * _mean_variance(values.mean(axis=1)), len(values) - 1)
        for weight, values in terms
    ]
    per_trial = np.sum([weight * values.mean(axis=0) for weight, values in terms], axis=0)
    return student(value, [*parts, (_mean_variance(per_trial), len(per_trial) - 1)])


def student(value: float, components: Iterable[tuple[float, int]]) -> Estimate:
    """Interval from independent components of the variance.

    They are estimated variances that add up to that of the statistic, with their degrees of
    freedom; where one has none, there is no interval.
    """
    from scipy.special import stdtrit

    variances, freedom = (np.array(part, dtype=float) for part in zip(*components, strict=True))
    if not freedom.all():
        return Estimate(value, None)
    total = float(variances.sum())
    if not total:
        return Estimate(value, (value, value))
    effective = total**2 / float((variances**2 / freedom).sum())
    reach = float(stdtrit(effective, (1 + LEVEL) / 2)) * total**0.5
    return Estimate(value, (value - reach, value + reach))


def mean_share(shares: NDArray[np.float64], n_trials: int) -> Estimate:
    """Mean of the seeds' shares of trials.

    The trials' part of the variance is that of a binomial share, with two hits and two misses
    added (Agresti and Coull), so that it never vanishes. The ``n_trials`` count as if all seeds
    had met the same ones.
    """
    value = float(shares.mean())
    moderate = (value * n_trials + 2) / (n_trials + 4)
    binomial = moderate * (1 - moderate) / (n_trials + 4)
    components = [(_mean_variance(shares), len(shares) - 1), (binomial, n_trials - 1)]
    ci95 = student(value, components).ci95
    return Estimate(value, ci95 and (max(ci95[0], 0.0), min(ci95[1], 1.0)))


def share_over_seeds(hits: NDArray[Any]) -> Estimate:
    """A share of trials and its 95 % interval.

    That of one seed is Wilson's. That of several covers Wilson's and the one over seeds and trials
    (`contrast`), which says nothing where all seeds agree. Hits, shape (n_seeds, n_trials), may be
    shares of several trainings as well.
    """
    share = float(hits.mean())
    low, high = wilson_interval(round(share * hits.shape[1]), hits.shape[1])
    if len(hits) > 1:
        crossed = contrast([(1.0, hits.astype(np.float64))]).ci95 or (share, share)
        low, high = min(low, crossed[0]), max(high, crossed[1])
    return Estimate(share, (max(low, 0.0), min(high, 1.0)))


def superiority(pairs: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]]) -> Estimate:
    """Probability that a member of the first group is below one of the second; ties count half.

    Measures of the same groups, and then pairs of groups, are averaged. The interval is Wilson's,
    for as many independent comparisons as the smaller groups have members: the variance of the
    statistic is at most theirs (van Dantzig 1951). Groups have shape (n_measures, n_seeds);
    infinity stands for never.
    """
    below = [
        (first[:, :, None] < second[:, None]) + 0.5 * (first[:, :, None] == second[:, None])
        for first, second in pairs
    ]
    value = float(np.mean([comparisons.mean() for comparisons in below]))
    n = sum(min(first.shape[1], second.shape[1]) for first, second in pairs)
    z2 = DEVIATIONS**2
    centre = (value + z2 / (2 * n)) / (1 + z2 / n)
    reach = (z2 * (value * (1 - value) / n + z2 / (4 * n * n))) ** 0.5 / (1 + z2 / n)
    return Estimate(value, (centre - reach, centre + reach))


def _mean_variance(values: NDArray[np.float64]) -> float:
    """Variance of the mean of independent values; 0 for a single one."""
    return float(values.var(ddof=1)) / len(values) if len(values) > 1 else 0.0
