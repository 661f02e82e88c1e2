"""The figures of merit of outcomes, with their 95 % intervals."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.metrics import METRICS, Metric
from kinarm.evaluation.outcomes import Outcomes
from kinarm.evaluation.statistics import (
    Estimate,
    Interval,
    percentile_interval,
    resamples,
    share_over_seeds,
    student,
)


def estimate_metrics(outcomes: Outcomes) -> dict[str, Estimate]:
    """Compute all `METRICS`, with their intervals; unknown figures stay empty.

    The interval of one policy is about other trials, that of several training seeds about other
    trainings and other trials.
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

    Those of several training seeds add the variance over the seeds to that over the trials, which
    all of them meet, as `contrast` does of means.
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
