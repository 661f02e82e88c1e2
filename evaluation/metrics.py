"""The figures of merit, in one table."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from kinarm._tables import ALWAYS
from kinarm.evaluation.outcomes import EARLY_STEPS, HOLDING_STEPS, Outcomes

FINAL = "final distance over all trials, however they ended"
APPROACH = "closest approach over all trials, if success does not end them; contact does"
"""Distances of which there are statistics."""

LIMITS = (0.1, 0.2)
"""Distances whose shares are reported beside success [m]."""

CLOSE = (0.02, 0.01, 0.005)
"""Distances whose shares are reported if success does not end trials [m]."""

HOLDING_WITHIN = 0.01
"""Distance within which the tool stays to the end if a goal is held [m]."""


@dataclass(frozen=True, kw_only=True)
class Metric:
    """A figure of merit: meaning, formula and how tables show it.

    Attributes
    ----------
    meaning, definition : str
        What it is, and its mathematical formula, with the letters of the
        documentation.
    formula : callable
        From `Outcomes` to the figure; None or NaN if unknown. For intervals it
        works along the last axis of many resamples.
    unit : str
        ``"%"`` for shares, kept as fractions and shown in per cent.
    interval : ``"mid-P"``, ``"Student"``, ``"bootstrap"`` or None
        How its 95 % interval is made. The first two are for shares and means
        of trials; the formula also gets each trial by itself.
    needs_holding : bool
        Whether it needs trials that go on after success.
    heading : str
        Heading of its column; without one it is in documents alone.
    digits, shows_interval : int, bool
        Decimals, and whether the interval is shown.
    beside : tuple of str, optional
        Another metric in the same column, and how it is shown, such as ``"{}
        s"``.
    priority : float
        Where space is scarce, columns of low priority are left out first.
    """

    meaning: str
    definition: str
    formula: Callable[[Outcomes], Any]
    unit: str = ""
    interval: Literal["mid-P", "Student", "bootstrap"] | None = None
    needs_holding: bool = False
    heading: str = ""
    digits: int = 3
    shows_interval: bool = False
    beside: tuple[str, str] | None = None
    priority: float = 0

    def write(self, value: float, *, sign: str = "") -> str:
        """A value of the metric as text; sign ``"+"`` also for positive ones."""
        return f"{100 * value if self.unit == '%' else value:{sign}.{self.digits}f}"

    def write_range(self, low: float, high: float, *, sign: str = "") -> str:
        """A range of values as text."""
        return f"{self.write(low, sign=sign)}..{self.write(high, sign=sign)}"


def _share_of(
    meaning: str, definition: str, hits: Callable[..., NDArray[np.bool_]], **shown: Any
) -> Metric:
    """Share of trials that hit."""
    return Metric(
        meaning=f"share of all trials {meaning}",
        definition=definition,
        formula=lambda trials: hits(trials).mean(axis=-1),
        unit="%",
        interval="mid-P",
        digits=1,
        **shown,
    )


_distance = partial(Metric, unit="m", interval="bootstrap")
"""A statistic of distances from the goal."""


def _middle_half(ordered: NDArray[np.float64]) -> NDArray[np.float64]:
    n = ordered.shape[-1]
    return ordered[..., n // 4 : n - n // 4]


def _median_or_none(values: NDArray[Any]) -> Any:
    return np.median(values) if values.size else None


METRICS: dict[str, Metric] = {
    "success": _share_of(
        "that ended within the tolerance, without contact",
        "|S| / n",
        lambda trials: trials.success,
        heading="success %",
        shows_interval=True,
        priority=ALWAYS,
    ),
    "relative_success": Metric(
        meaning="success divided by the success of the oracle in the same trials",
        definition="success / success of the oracle, both over the bounded trials",
        formula=lambda trials: trials.relative_success,
        unit="%",
        heading="relative success %",
        digits=1,
        priority=11,
    ),
    **{
        f"within_{limit:g}": _share_of(
            f"with a final distance of at most {limit:g} m, however they ended",
            f"|{{i : dᵢ ≤ {limit:g} m}}| / n",
            lambda trials, limit=limit: trials.distance <= limit,
            heading=f"within {limit:g} m %",
            priority=1,
        )
        for limit in LIMITS
    },
    "median_distance": _distance(
        meaning=f"median of the {FINAL}",
        definition="median of dᵢ",
        formula=lambda trials: np.median(trials.ordered_distance, axis=-1),
        heading="median distance m",
        shows_interval=True,
        priority=10,
    ),
    "mean_distance": _distance(
        meaning=f"mean of the {FINAL}",
        definition="Σ dᵢ / n",
        interval="Student",
        formula=lambda trials: trials.distance.mean(axis=-1),
        heading="mean distance m",
        priority=2,
    ),
    "iqm_distance": _distance(
        meaning=f"interquartile mean of the {FINAL}",
        definition="mean of dᵢ without the smallest and the largest quarter",
        formula=lambda trials: _middle_half(trials.ordered_distance).mean(axis=-1),
    ),
    "p95_distance": _distance(
        meaning=f"95th percentile of the {FINAL}",
        definition="0.95 quantile of dᵢ, interpolated linearly",
        formula=lambda trials: np.quantile(trials.ordered_distance, 0.95, axis=-1),
        heading="p95 distance m",
        priority=2,
    ),
    "max_distance": Metric(
        meaning="largest final distance of all trials",
        definition="max dᵢ",
        formula=lambda trials: trials.distance.max(),
        unit="m",
    ),
    "collision": _share_of(
        "that ended in contact with an obstacle, the ground or the arm itself",
        "|C| / n",
        lambda trials: trials.collision,
        heading="collision %",
        priority=14.5,
    ),
    "replaced": Metric(
        meaning="share of the steps of all trials that a shield replaced",
        definition="Σ zᵢ / Σ kᵢ",
        formula=lambda trials: (
            trials.interventions.sum() / trials.steps.sum() if len(trials.interventions) else None
        ),
        unit="%",
        heading="replaced %",
        digits=2,
        priority=14.2,
    ),
    "early_collision": _share_of(
        f"that ended in contact within the first {EARLY_STEPS} steps",
        f"|{{i ∈ C : kᵢ ≤ {EARLY_STEPS}}}| / n",
        lambda trials: trials.collision & (trials.steps <= EARLY_STEPS),
        heading="early collision %",
        priority=0.5,
    ),
    "truncated": _share_of(
        "that took all steps without success or contact",
        "|T| / n",
        lambda trials: ~(trials.success | trials.collision),
        heading="truncated %",
        priority=0.5,
    ),
    "mean_steps": Metric(
        meaning="mean number of steps over all trials, failures included",
        definition="Σ kᵢ / n",
        formula=lambda trials: trials.steps.mean(),
    ),
    "median_steps": Metric(
        meaning="median number of steps over all trials, failures included",
        definition="median of kᵢ",
        formula=lambda trials: np.median(trials.steps),
        heading="median steps",
        digits=0,
        priority=0.2,
    ),
    "steps_to_success": Metric(
        meaning="median number of steps over the trials that succeeded, and the same as time",
        definition="median of kᵢ over i ∈ S",
        formula=lambda trials: _median_or_none(trials.steps[trials.success]),
        heading="steps to success",
        digits=0,
        beside=("time_to_success", "{} s"),
        priority=3,
    ),
    "time_to_success": Metric(
        meaning="median duration of the trials that succeeded",
        definition="median of kᵢ times the duration of a step, over i ∈ S",
        formula=lambda trials: _median_or_none(trials.steps[trials.success] * trials.time_step),
        unit="s",
        digits=2,
    ),
    "goals_per_minute": Metric(
        meaning="goals of sequences that were reached, per minute of simulated time",
        definition="60 Σ gᵢ / Σ kᵢ, by the duration of a step in seconds",
        formula=lambda trials: trials.goals_per_minute,
        heading="goals per minute",
        digits=1,
        priority=12,
    ),
    "median_turn": Metric(
        meaning="median of the final errors of direction, rotation or joints over all trials",
        definition="median of rᵢ",
        formula=lambda trials: _median_or_none(trials.turn),
        unit="rad",
        heading="median turn rad",
        priority=9,
    ),
    "step_ratio": Metric(
        meaning="median of steps divided by the bound, over the bounded trials that succeeded",
        definition="median of kᵢ / bᵢ over the bounded i ∈ S",
        formula=lambda trials: _median_or_none(trials.step_ratio),
        heading="step ratio",
        digits=2,
        beside=("step_ratio_p95", "p95 {}"),
        priority=8,
    ),
    "step_ratio_p95": Metric(
        meaning="95th percentile of steps divided by the bound, over the same trials",
        definition="0.95 quantile of kᵢ / bᵢ over the bounded i ∈ S",
        formula=lambda trials: (
            np.percentile(trials.step_ratio, 95) if trials.step_ratio.size else None
        ),
        digits=2,
    ),
    **{
        f"closer_than_{1000 * limit:g}_mm": _share_of(
            f"that come within {1000 * limit:g} mm of the goal, if success does not end them; "
            "without contact at any time",
            f"|{{i ∉ H : aᵢ ≤ {limit:g} m}}| / n",
            lambda trials, limit=limit: (trials.closest <= limit) & ~trials.holding_collision,
            heading=f"closer than {1000 * limit:g} mm %",
            needs_holding=True,
            priority=14,
        )
        for limit in CLOSE
    },
    "held": _share_of(
        f"whose last {HOLDING_STEPS} steps stay within {1000 * HOLDING_WITHIN:g} mm of the goal, "
        "if success does not end them; without contact",
        f"|{{i ∉ H : eᵢ ≤ {HOLDING_WITHIN:g} m}}| / n",
        lambda trials: (trials.farthest_at_end <= HOLDING_WITHIN) & ~trials.holding_collision,
        heading="held %",
        needs_holding=True,
        shows_interval=True,
        priority=15,
    ),
    "median_approach": _distance(
        meaning=f"median of the {APPROACH}",
        definition="median of aᵢ",
        formula=lambda trials: np.median(trials.closest, axis=-1),
        needs_holding=True,
        heading="median approach m",
        beside=("p95_approach", "p95 {}"),
        priority=13,
    ),
    "p95_approach": _distance(
        meaning=f"95th percentile of the {APPROACH}",
        definition="0.95 quantile of aᵢ, interpolated linearly",
        formula=lambda trials: np.quantile(trials.closest, 0.95, axis=-1),
        needs_holding=True,
    ),
    "held_collision": _share_of(
        "that touch something if success does not end them",
        "|H| / n",
        lambda trials: trials.holding_collision,
        heading="held collision %",
        needs_holding=True,
        priority=8.5,
    ),
}
"""All figures of merit by their name in documents."""
