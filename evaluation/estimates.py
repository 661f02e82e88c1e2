"""Figures of merit of outcomes, and differences of them, with 95 % intervals."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.metrics import METRICS, Metric
from kinarm.evaluation.outcomes import Outcomes
from kinarm.evaluation.statistics import (
    LEVEL,
    Estimate,
    Interval,
    mean_interval,
    share_difference,
    share_over_seeds,
    squared_reach,
    student,
)

RESAMPLES = 1000
BOOTSTRAP_SEED = 0

NUMBERS_AT_ONCE = 400_000
"""Trial numbers that are resampled at once, which limits the memory."""


def estimate_metrics(
    outcomes: Outcomes, less: Outcomes | None = None, *, paired: bool = False
) -> dict[str, Estimate]:
    """Compute all `METRICS` with intervals; unknown figures stay empty.

    Outcomes are of one policy, or of the seeds of a recipe; the figures of others in the same
    trials, ``less``, are subtracted. Intervals are about other trials, and with several training
    seeds also about other trainings. ``paired`` seeds of both sides are of the same trainings.
    """
    sides = (outcomes,) if less is None else (outcomes, less)
    known = {
        name: metric
        for name, metric in METRICS.items()
        if all(side.holding for side in sides) or not metric.needs_holding
    }
    intervals = _bootstrapped(sides, known, paired) | _of_means(sides, known, paired)
    estimates = dict.fromkeys(METRICS, Estimate(None))
    for name, metric in known.items():
        values = [metric.formula(side) for side in sides]
        if all(value is not None and not np.isnan(value) for value in values):
            ci95 = intervals.get(name)
            if ci95 and metric.unit == "m" and less is None:
                ci95 = (max(ci95[0], 0.0), ci95[1])
            estimates[name] = Estimate(float(_less(values)), ci95)
    return estimates


def _less(values: Sequence[Any]) -> Any:
    """The value of one side, or the first less the second."""
    return values[0] if len(values) == 1 else values[0] - values[1]


def _trials(sides: Sequence[Outcomes]) -> int:
    return len(sides[0].rollouts[0].success)


def _paired(first: NDArray[np.float64], second: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Both without what seeds of the second differ in, which is common to the same trainings."""
    common = second - second.mean(axis=0)
    return [first - common, second - common]


def _of_means(
    sides: Sequence[Outcomes], known: Mapping[str, Metric], paired: bool
) -> dict[str, Interval | None]:
    """Intervals of the metrics that are means over trials."""
    each = np.arange(_trials(sides))[:, None]
    alone = [
        [side.of_seed(seed).resampled(each) for seed in range(len(side.rollouts))] for side in sides
    ]
    intervals = {}
    for name, metric in known.items():
        if metric.interval in ("mid-P", "Student"):
            values = [np.array([metric.formula(seed) for seed in seeds]) for seeds in alone]
            if paired:
                values = _paired(*values)
            if metric.interval == "Student":
                intervals[name] = mean_interval(*values)
            else:
                of_shares = share_over_seeds if len(values) == 1 else share_difference
                intervals[name] = of_shares(*values).ci95
    return intervals


def _bootstrapped(
    sides: Sequence[Outcomes], known: Mapping[str, Metric], paired: bool
) -> dict[str, Interval | None]:
    """Intervals of other metrics, from resamples of the trials.

    With several training seeds, the reach of Student's interval over the seeds is added to that
    over the trials, as in `contrast`.
    """
    formulas = {name: each.formula for name, each in known.items() if each.interval == "bootstrap"}

    def figures(some: Outcomes) -> NDArray[np.float64]:
        return np.stack([formula(some) for formula in formulas.values()])

    trials = _trials(sides)
    if trials == 1:
        return dict.fromkeys(formulas)
    found = np.concatenate(
        [
            _less([figures(side.resampled(numbers)) for side in sides])
            for numbers in resamples(trials)
        ],
        axis=-1,
    )
    of_seeds = [
        np.array([figures(side.of_seed(seed)) for seed in range(len(side.rollouts))])
        for side in sides
        if len(side.rollouts) > 1
    ]
    if not of_seeds:
        return dict(zip(formulas, map(percentile_interval, found), strict=True))
    of_trials = student(trials) ** 2 * found.var(axis=-1, ddof=1)
    if paired:
        of_seeds = _paired(*of_seeds)
    reaches = np.sqrt(squared_reach(*of_seeds) + of_trials)
    middles = _less([figures(side) for side in sides])
    ends = np.stack([middles - reaches, middles + reaches], axis=-1).tolist()
    return {name: (low, high) for name, (low, high) in zip(formulas, ends, strict=True)}


def percentile_interval(figures: NDArray[np.float64]) -> Interval:
    """Ends of the middle 95 % of figures, shape (n_resamples,)."""
    ordered, tail = np.sort(figures), (1 - LEVEL) / 2
    return _quantile(ordered, tail), _quantile(ordered, 1 - tail)


def resamples(trials: int) -> Iterator[NDArray[np.int64]]:
    """Trial numbers of all resamples, in pieces of shape (n, trials); seeded."""
    rng, at_once = np.random.default_rng(BOOTSTRAP_SEED), max(1, NUMBERS_AT_ONCE // trials)
    for done in range(0, RESAMPLES, at_once):
        yield rng.integers(trials, size=(min(at_once, RESAMPLES - done), trials))


def _quantile(ordered: NDArray[np.float64], share: float) -> float:
    """Quantile, interpolated linearly."""
    rank = share * len(ordered) + (1 - share)
    below, beyond = int(rank) - 1, rank % 1
    return float((1 - beyond) * ordered[below] + beyond * ordered[below + 1])
