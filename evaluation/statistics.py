"""Estimates with 95 % intervals."""

from collections.abc import Callable, Iterable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

LEVEL = 0.95
RESAMPLES = 1000
BOOTSTRAP_SEED = 0

NUMBERS_AT_ONCE = 400_000
"""How many trial numbers are resampled at once, so that many trials do not fill the memory."""

Interval = tuple[float, float]


class Estimate(NamedTuple):
    """A figure of merit.

    Attributes
    ----------
    value : float or None
        The figure; None where there is nothing to tell.
    ci95 : tuple of float, or None
        Its 95 % interval, where it has one.
    """

    value: float | None
    ci95: Interval | None = None

    @classmethod
    def share(cls, hits: NDArray[np.bool_]) -> "Estimate":
        """Share of hits, with its Wilson interval.

        Parameters
        ----------
        hits : ndarray of bool, shape (n_trials,) or (n_seeds, n_trials)
            Whether a trial hit. Several seeds face the same trials, so they are no independent
            evidence about them: their interval is that of n_trials trials, widened to whole hits.
        """
        seeds = hits.size // hits.shape[-1]
        return cls(float(hits.mean()), wilson_interval(int(hits.sum()), hits.shape[-1], seeds))

    def __str__(self) -> str:
        interval = " ({:.3g}..{:.3g})".format(*self.ci95) if self.ci95 else ""
        return "unknown" if self.value is None else f"{self.value:.3g}{interval}"

    def to_json(self) -> dict[str, Any]:
        """As a dictionary that JSON can hold."""
        return {"value": self.value, "ci95": self.ci95 and list(self.ci95)}


def wilson_interval(hits: int, trials: int, seeds: int = 1) -> Interval:
    """95 % interval of a share of trials, from the hits of all seeds together.

    Every seed faced the trials; see `Estimate.share`.
    """
    few, many = hits // seeds, -(-hits // seeds)
    return _wilson_interval(few, trials)[0], _wilson_interval(many, trials)[1]


@cache
def _wilson_interval(hits: int, trials: int) -> Interval:
    """Interval of whole hits; profiles ask for the same ones over and over."""
    from scipy.stats import binomtest

    interval = binomtest(hits, trials).proportion_ci(confidence_level=LEVEL, method="wilson")
    return float(interval.low), float(interval.high)


def performance_profile(
    distances: NDArray[np.float64], limits: Iterable[float]
) -> tuple[Estimate, ...]:
    """Shares of trials whose final distance is at most each of some limits [m].

    Distances [m] have shape (n_trials,) or (n_seeds, n_trials); see `Estimate.share`.
    """
    return tuple(Estimate.share(distances <= limit) for limit in limits)


def bootstrap_intervals(
    trials: int, figures: Callable[[NDArray[np.int64]], NDArray[np.float64]]
) -> list[Interval | None]:
    """Seeded percentile intervals of some figures over resamples of the trials.

    Parameters
    ----------
    trials : int
        Number of trials. A single one tells nothing about the spread: None for every figure.
    figures : callable
        From numbers of trials, shape (n_resamples, trials) or (trials,), to the figures of each
        resample, shape (n_figures, n_resamples) or (n_figures,).
    """
    from scipy.stats import bootstrap

    numbers = np.arange(trials)
    if trials == 1:
        return [None] * len(figures(numbers))
    interval = bootstrap(
        (numbers,),
        lambda resampled, axis: figures(resampled),  # noqa: ARG005 - along the last axis, always
        n_resamples=RESAMPLES,
        batch=max(1, NUMBERS_AT_ONCE // trials),
        confidence_level=LEVEL,
        method="percentile",
        vectorized=True,
        rng=np.random.default_rng(BOOTSTRAP_SEED),
    ).confidence_interval
    return [(float(low), float(high)) for low, high in np.transpose(interval)]
