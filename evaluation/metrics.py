"""The figures of merit in one table, which documents, tables, reports and the docs read."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from kinarm.errors import InvalidInputError
from kinarm.evaluation.statistics import Estimate, bootstrap_intervals, wilson_interval

LIMITS = (0.1, 0.2)
"""Distances whose shares are reported beside success [m]."""

ALWAYS = float("inf")
"""Priority of columns that are never left out."""


class Judged(Protocol):
    """What figures of merit need of finished episodes; `kinarm.Rollouts` say what it means."""

    @property
    def distance(self) -> NDArray[np.float64]:
        """Final distances [m]."""

    @property
    def steps(self) -> NDArray[np.int64]:
        """Steps taken."""

    @property
    def returns(self) -> NDArray[np.float64]:
        """Sums of rewards."""

    @property
    def success(self) -> NDArray[np.bool_]:
        """Whether the goal was reached."""

    @property
    def collision(self) -> NDArray[np.bool_]:
        """Whether something touched."""

    def __len__(self) -> int: ...


class Bounded(Protocol):
    """What figures of merit need of the bounds, as the oracle's solutions have it."""

    @property
    def reachable(self) -> NDArray[np.bool_]:
        """Whether a motion to the goal was found."""

    @property
    def steps_lower_bound(self) -> NDArray[np.int64]:
        """Steps that are necessary."""


@dataclass(frozen=True, eq=False)
class Outcomes:
    """What one or several training seeds did in the same trials.

    Their arrays are joined along the last axis, shape (..., n_seeds * n_trials).

    Attributes
    ----------
    rollouts : tuple of Rollouts
        One per training seed.
    bounds : OracleSolutions or None
        What any policy could do in the trials, if that is known.
    numbers : ndarray of int, shape (..., n_trials), optional
        Resampled trials; by default each of them once.
    """

    rollouts: tuple[Judged, ...]
    bounds: Bounded | None = None
    numbers: NDArray[np.int64] | None = None

    def _joined(self, columns: Iterable[NDArray[Any]]) -> NDArray[Any]:
        chosen = [column if self.numbers is None else column[self.numbers] for column in columns]
        return np.concatenate(chosen, axis=-1)

    @cached_property
    def distance(self) -> NDArray[np.float64]:
        """Final distances [m]."""
        return self._joined(rollouts.distance for rollouts in self.rollouts)

    @cached_property
    def ordered_distance(self) -> NDArray[np.float64]:
        """Final distances along the last axis, the smallest first [m]."""
        return np.sort(self.distance, axis=-1)

    @cached_property
    def steps(self) -> NDArray[np.int64]:
        """Steps taken."""
        return self._joined(rollouts.steps for rollouts in self.rollouts)

    @cached_property
    def returns(self) -> NDArray[np.float64]:
        """Sums of rewards."""
        return self._joined(rollouts.returns for rollouts in self.rollouts)

    @cached_property
    def success(self) -> NDArray[np.bool_]:
        """Whether a trial ended within the tolerance, without contact."""
        return self._joined(rollouts.success for rollouts in self.rollouts)

    @cached_property
    def collision(self) -> NDArray[np.bool_]:
        """Whether a trial ended in contact."""
        return self._joined(rollouts.collision for rollouts in self.rollouts)

    @cached_property
    def reachable(self) -> NDArray[np.bool_]:
        """Whether the oracle found a motion to the goal."""
        return self._joined(self._known_bounds.reachable for _ in self.rollouts)

    @cached_property
    def step_ratio(self) -> NDArray[np.float64]:
        """Steps taken over those proven necessary, of the trials that succeeded, one axis."""
        necessary = self._joined(self._known_bounds.steps_lower_bound for _ in self.rollouts)
        ratio: NDArray[np.float64] = self.steps / necessary
        return ratio[self.success]

    @property
    def _known_bounds(self) -> Bounded:
        if self.bounds is None:
            raise InvalidInputError("there are no bounds: the evaluation was made without them")
        return self.bounds


@dataclass(frozen=True, kw_only=True)
class Metric:
    """A figure of merit: what it means, how it is computed and how it is shown.

    Attributes
    ----------
    meaning : str
        What it is, for documentation and reports.
    formula : callable
        From `Outcomes` to the figure; None or NaN where there is nothing to tell. For an interval
        it is asked about many resamples at once and works along the last axis.
    unit : str
        ``"%"`` for shares, which are kept as fractions and shown in per cent.
    interval : ``"Wilson"``, ``"bootstrap"`` or None
        How its 95 % interval is made. Wilson's is for shares of trials.
    needs_bounds : bool
        Whether it compares with the oracle.
    heading : str
        Heading of its column in tables; without one it is in documents alone.
    digits : int
        Decimals that are shown.
    shows_interval : bool
        Whether the interval is shown, too.
    beside : tuple of str, optional
        Label and name of another metric that is shown in the same column.
    spread_heading : str
        Heading of a column for its range over training seeds, if there is to be one.
    priority : float
        Where space is scarce, columns of low priority are left out first, and those of infinite
        priority never.
    """

    meaning: str
    formula: Callable[[Outcomes], Any]
    unit: str = ""
    interval: Literal["Wilson", "bootstrap"] | None = None
    needs_bounds: bool = False
    heading: str = ""
    digits: int = 3
    shows_interval: bool = False
    beside: tuple[str, str] | None = None
    spread_heading: str = ""
    priority: float = 0

    def write(self, value: float) -> str:
        """A value of the metric as text."""
        return f"{100 * value if self.unit == '%' else value:.{self.digits}f}"

    def write_range(self, low: float, high: float) -> str:
        """A range of values as text."""
        return f"{self.write(low)}..{self.write(high)}"


def share_within(limit: float) -> Metric:
    """Share of trials that end within a distance [m]."""
    return Metric(
        meaning=f"share of trials with a final distance of at most {limit:g} m; contact allowed",
        formula=lambda trials: (trials.distance <= limit).mean(axis=-1),
        unit="%",
        interval="Wilson",
        heading=f"<= {limit:g} m",
        digits=1,
        priority=1,
    )


def distance_metric(
    meaning: str, formula: Callable[[Outcomes], Any], heading: str = "", **shown: Any
) -> Metric:
    """A statistic of the final distance."""
    return Metric(
        meaning=f"{meaning} of the final distance",
        formula=formula,
        unit="m",
        interval="bootstrap",
        heading=heading,
        **shown,
    )


def median(ordered: NDArray[np.float64]) -> Any:
    """Median along the last axis of values that are ordered."""
    n = ordered.shape[-1]
    return (ordered[..., (n - 1) // 2] + ordered[..., n // 2]) / 2


def quantile(ordered: NDArray[np.float64], share: float) -> Any:
    """Quantile along the last axis, as NumPy interpolates it, of values that are ordered."""
    position = share * (ordered.shape[-1] - 1)
    low, beyond = ordered[..., math.floor(position)], position % 1
    high = ordered[..., math.ceil(position)]
    if beyond < 0.5:
        return low + (high - low) * beyond
    return high - (high - low) * (1 - beyond)


def middle_half(ordered: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ordered values without the smallest and the largest quarter, along the last axis."""
    n = ordered.shape[-1]
    return ordered[..., n // 4 : n - n // 4]


METRICS: dict[str, Metric] = {
    "success": Metric(
        meaning="share of trials that ended within the tolerance, without contact",
        formula=lambda trials: trials.success.mean(axis=-1),
        unit="%",
        interval="Wilson",
        heading="success %",
        digits=1,
        shows_interval=True,
        spread_heading="over seeds %",
        priority=ALWAYS,
    ),
    "relative_success": Metric(
        meaning="success over that of the oracle",
        formula=lambda trials: (
            trials.success.mean() / trials.reachable.mean() if trials.reachable.any() else None
        ),
        unit="%",
        needs_bounds=True,
        heading="of oracle %",
        digits=1,
        priority=7,
    ),
    **{f"within_{limit:g}": share_within(limit) for limit in LIMITS},
    "median_distance": distance_metric(
        "median",
        lambda trials: median(trials.ordered_distance),
        "median m",
        shows_interval=True,
        priority=ALWAYS,
    ),
    "mean_distance": distance_metric(
        "mean", lambda trials: trials.distance.mean(axis=-1), "mean m", priority=2
    ),
    "iqm_distance": distance_metric(
        "interquartile mean (of the middle half)",
        lambda trials: middle_half(trials.ordered_distance).mean(axis=-1),
    ),
    "p95_distance": distance_metric(
        "95th percentile",
        lambda trials: quantile(trials.ordered_distance, 0.95),
        "p95 m",
        priority=2,
    ),
    "max_distance": Metric(
        meaning="largest final distance",
        formula=lambda trials: trials.distance.max(),
        unit="m",
    ),
    "collision": Metric(
        meaning="share of trials that ended in contact: obstacles, the ground or the arm itself",
        formula=lambda trials: trials.collision.mean(axis=-1),
        unit="%",
        interval="Wilson",
        heading="contact %",
        digits=1,
        priority=6,
    ),
    "mean_steps": Metric(
        meaning="mean length of the episodes", formula=lambda trials: trials.steps.mean()
    ),
    "median_steps": Metric(
        meaning="median length of the episodes",
        formula=lambda trials: np.median(trials.steps),
        heading="steps",
        digits=0,
        priority=3,
    ),
    "step_ratio": Metric(
        meaning="steps over the number proven necessary, of the trials that succeeded: median",
        formula=lambda trials: np.median(trials.step_ratio) if trials.step_ratio.size else None,
        needs_bounds=True,
        heading="step ratio",
        digits=2,
        beside=("p95", "step_ratio_p95"),
        priority=8,
    ),
    "step_ratio_p95": Metric(
        meaning="the same: 95th percentile",
        formula=lambda trials: (
            np.percentile(trials.step_ratio, 95) if trials.step_ratio.size else None
        ),
        needs_bounds=True,
        digits=2,
    ),
}
"""All figures of merit by their name in documents. A new one is one entry here."""


def estimate_metrics(outcomes: Outcomes) -> dict[str, Estimate]:
    """Work out all `METRICS`, with their intervals; without bounds, some stay empty."""
    bounded = outcomes.bounds is not None
    known = {name: each for name, each in METRICS.items() if bounded or not each.needs_bounds}
    bootstrapped = [name for name, metric in known.items() if metric.interval == "bootstrap"]

    def resampled_figures(numbers: NDArray[np.int64]) -> NDArray[np.float64]:
        resampled = replace(outcomes, numbers=numbers)
        return np.stack([known[name].formula(resampled) for name in bootstrapped])

    trials, seeds = len(outcomes.rollouts[0]), len(outcomes.rollouts)
    intervals = dict(zip(bootstrapped, bootstrap_intervals(trials, resampled_figures), strict=True))
    estimates = dict.fromkeys(METRICS, Estimate(None))
    for name, metric in known.items():
        value = metric.formula(outcomes)
        if value is None or np.isnan(value):
            continue
        interval = intervals.get(name)
        if metric.interval == "Wilson":
            interval = wilson_interval(round(value * trials * seeds), trials, seeds)
        estimates[name] = Estimate(float(value), interval)
    return estimates
