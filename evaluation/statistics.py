"""Estimates with 95 % intervals.

Written out here, because SciPy's statistics take longer to load than a policy to evaluate.
"""

import math
from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

LEVEL = 0.95
RESAMPLES = 1000
BOOTSTRAP_SEED = 0

DEVIATIONS = 1.959963984540054
"""Standard deviations that enclose this share of a normal distribution."""

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


def _wilson_interval(hits: int, trials: int) -> Interval:
    """Interval of whole hits (Wilson 1927); exact where none or all hit."""
    share, z = hits / trials, DEVIATIONS
    spread = 2 * (trials + z**2)
    centre = (2 * trials * share + z**2) / spread
    half = z / spread * math.sqrt(4 * trials * share * (1 - share) + z**2)
    return centre - half if hits > 0 else 0.0, centre + half if hits < trials else 1.0


def resampled_figures(
    trials: int, figures: Callable[[NDArray[np.int64]], NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Some figures of resamples of the trials, shape (n_figures, n_resamples); seeded.

    Parameters
    ----------
    trials : int
        Number of trials.
    figures : callable
        From numbers of trials, shape (n_resamples, trials), to the figures of each resample,
        shape (n_figures, n_resamples).
    """
    few = RESAMPLES * trials <= NUMBERS_AT_ONCE
    pieces = _few_resamples(trials) if few else _resamples(trials)
    return np.concatenate([figures(piece) for piece in pieces], axis=-1)


def percentile_interval(figures: NDArray[np.float64]) -> Interval:
    """What encloses 95 % of the figures of all resamples, shape (n_resamples,)."""
    ordered, tail = np.sort(figures), (1 - LEVEL) / 2
    return float(_quantile(ordered, tail)), float(_quantile(ordered, 1 - tail))


def _resamples(trials: int) -> Iterator[NDArray[np.int64]]:
    """Numbers of the trials of all resamples, a piece of shape (n, trials) at a time."""
    rng, at_once = np.random.default_rng(BOOTSTRAP_SEED), max(1, NUMBERS_AT_ONCE // trials)
    for done in range(0, RESAMPLES, at_once):
        yield rng.integers(trials, size=(min(at_once, RESAMPLES - done), trials))


@lru_cache(maxsize=1)
def _few_resamples(trials: int) -> tuple[NDArray[np.int64], ...]:
    """The same, kept: policies face as many trials one after the other."""
    return tuple(_resamples(trials))


def _quantile(ordered: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """Quantile along the last axis, interpolated linearly."""
    rank = share * ordered.shape[-1] + (1 - share)
    below, beyond = int(rank) - 1, rank % 1
    quantile: NDArray[np.float64]
    quantile = (1 - beyond) * ordered[..., below] + beyond * ordered[..., below + 1]
    return quantile
