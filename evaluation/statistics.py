"""Figures of merit with 95 % intervals."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

RESAMPLES = 1000
BOOTSTRAP_SEED = 0

Interval = tuple[float, float]


@dataclass(frozen=True)
class Share:
    """A share of trials.

    Attributes
    ----------
    rate : float
        The share.
    ci95 : tuple of float
        Wilson interval.
    """

    rate: float
    ci95: Interval

    @classmethod
    def of(cls, hits: NDArray[np.bool_]) -> "Share":
        """Share of hits.

        Parameters
        ----------
        hits : ndarray of bool, shape (n_trials,) or (n_seeds, n_trials)
            Whether a trial hit. Several seeds face the same trials, so they are no independent
            evidence about them: their interval is that of n_trials trials, widened to whole hits.
        """
        rate, trials = float(hits.mean()), hits.shape[-1]
        expected = hits.sum() / (hits.size // trials)
        few, many = int(np.floor(expected)), int(np.ceil(expected))
        return cls(rate, (_wilson(few, trials)[0], _wilson(many, trials)[1]))

    def to_json(self) -> dict[str, Any]:
        """As a dictionary that JSON can hold."""
        return {"rate": self.rate, "ci95": list(self.ci95)}


@cache
def _wilson(hits: int, trials: int) -> Interval:
    """95 % interval of a share; profiles ask for the same ones over and over."""
    from scipy.stats import binomtest

    interval = binomtest(hits, trials).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)


def performance_profile(
    distances: NDArray[np.float64], limits: Iterable[float]
) -> tuple[Share, ...]:
    """Shares of trials whose final distance is at most each of some limits.

    Parameters
    ----------
    distances : ndarray, shape (n_trials,) or (n_seeds, n_trials)
        Final distances [m]; several seeds face the same trials, see `Share.of`.
    limits : iterable of float
        The limits [m].
    """
    return tuple(Share.of(distances <= limit) for limit in limits)


@dataclass(frozen=True)
class DistanceStatistics:
    """Statistics of final distances [m].

    Attributes
    ----------
    mean, median, iqm, p95, max : float
        Mean, median, interquartile mean, 95th percentile and maximum.
    ci95 : dict
        Seeded bootstrap intervals of all but the maximum; None for a single trial, which tells
        nothing about the spread.
    """

    mean: float
    median: float
    iqm: float
    p95: float
    max: float
    ci95: dict[str, Interval | None]

    @classmethod
    def of(cls, distances: NDArray[np.float64]) -> "DistanceStatistics":
        """Summarise final distances.

        Parameters
        ----------
        distances : ndarray, shape (n_trials,) or (n_seeds, n_trials)
            Final distances [m]. Trials are resampled for all seeds alike.
        """
        from scipy.stats import bootstrap

        samples = tuple(np.atleast_2d(distances))
        ci95: dict[str, Interval | None] = dict.fromkeys(ESTIMATES)
        if len(samples[0]) > 1:
            interval = bootstrap(
                samples,
                _estimates,
                n_resamples=RESAMPLES,
                method="percentile",
                paired=len(samples) > 1,
                vectorized=True,
                rng=np.random.default_rng(BOOTSTRAP_SEED),
            ).confidence_interval
            for name, low, high in zip(ESTIMATES, *np.array(interval), strict=True):
                ci95[name] = (float(low), float(high))
        estimates = dict(zip(ESTIMATES, _estimates(*samples).tolist(), strict=True))
        return cls(**estimates, max=float(np.max(distances)), ci95=ci95)

    def to_json(self) -> dict[str, Any]:
        """As a dictionary that JSON can hold."""
        figures = {name: getattr(self, name) for name in (*ESTIMATES, "max")}
        return {**figures, "ci95": {name: ci and list(ci) for name, ci in self.ci95.items()}}


ESTIMATES = ("mean", "median", "iqm", "p95")
"""Statistics that get an interval."""


def _estimates(*samples: NDArray[np.float64], axis: int = -1) -> NDArray[np.float64]:
    """Pool samples along an axis and estimate `ESTIMATES`, stacked along the first axis."""
    from scipy.stats import trim_mean

    pooled = np.concatenate(samples, axis=axis)
    return np.stack(
        [
            pooled.mean(axis=axis),
            np.median(pooled, axis=axis),
            trim_mean(pooled, 0.25, axis=axis),
            np.quantile(pooled, 0.95, axis=axis),
        ]
    )
