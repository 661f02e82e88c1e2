"""What the trainings of a comparison came to, learner by learner."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.comparison.learners import ComparedLearner
from kinarm.evaluation.comparison.runs import CurvePoint, PlannedRun
from kinarm.evaluation.statistics import Estimate, wilson_interval
from kinarm.evaluation.trials import trial_set
from kinarm.problem import ReachProblem

LEVELS = (0.5, 0.8)
"""Shares of success by which the speed of learning is told."""

Curve = tuple[CurvePoint, ...]


@dataclass(frozen=True, eq=False)
class Series:
    """The training seeds of a learner on a problem.

    Attributes
    ----------
    learner : ComparedLearner
        Who learnt.
    problem : ReachProblem
        What.
    trials : int
        Number of trials that the policies faced.
    curves : tuple of tuple of CurvePoint
        How they did, one per seed.
    """

    learner: ComparedLearner
    problem: ReachProblem
    trials: int
    curves: tuple[Curve, ...]

    @property
    def success(self) -> Estimate:
        """Share of trials in which the trained policies succeeded."""
        return self._share([curve[-1].successes for curve in self.curves])

    @property
    def collision(self) -> Estimate:
        """Share of trials in which they touched something."""
        return self._share([curve[-1].collisions for curve in self.curves])

    @property
    def steps_to_success(self) -> float | None:
        """Median steps of the trials that succeeded, mean over the seeds; None if not known."""
        known = [curve[-1].steps_to_success for curve in self.curves]
        each = [steps for steps in known if steps is not None]
        return float(np.mean(each)) if len(each) == len(known) else None

    def _share(self, hits: list[int]) -> Estimate:
        """Share over all seeds; as in `Estimate.share`, they are no independent evidence."""
        interval = wilson_interval(sum(hits), self.trials, len(hits))
        return Estimate(sum(hits) / len(hits) / self.trials, interval)

    def last(self, quantity: str) -> float:
        """Mean over the seeds of something at the end of the training."""
        return float(np.mean([getattr(curve[-1], quantity) for curve in self.curves]))

    def until(self, level: float, quantity: str) -> float:
        """Steps or time until policies first succeed in a share of trials; median over seeds.

        Infinity for a seed that never gets there.
        """
        needed = []
        for curve in self.curves:
            there = [point for point in curve if point.successes >= level * self.trials]
            needed.append(float(getattr(there[0], quantity)) if there else math.inf)
        return float(np.median(needed))

    def success_at(self, quantity: str, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Share of success of each seed, shape (n_seeds, n), where steps or time are given.

        Linear between the points of a curve and NaN outside.
        """
        return np.array(
            [
                np.interp(
                    places,
                    [getattr(point, quantity) for point in curve],
                    [point.successes / self.trials for point in curve],
                    left=math.nan,
                    right=math.nan,
                )
                for curve in self.curves
            ]
        )


@dataclass(frozen=True, eq=False)
class Comparison:
    """Finished trainings, and what could be reached in their trials.

    Attributes
    ----------
    curves : mapping of PlannedRun to tuple of CurvePoint
        What each of them came to, at least one.
    """

    curves: Mapping[PlannedRun, Curve]

    @cached_property
    def series(self) -> tuple[Series, ...]:
        """The trainings by problem and learner, in the order in which they were planned."""
        grouped: dict[tuple[str, str], list[tuple[PlannedRun, Curve]]] = {}
        for run, curve in self.curves.items():
            grouped.setdefault((run.problem.name, run.learner.name), []).append((run, curve))
        return tuple(
            Series(
                *(pairs[0][0].learner, pairs[0][0].problem, pairs[0][0].protocol.trials),
                tuple(curve for _, curve in pairs),
            )
            for pairs in grouped.values()
        )

    @cached_property
    def reachable(self) -> dict[str, float]:
        """Share of the trials in which any policy could succeed, by problem; the oracle's."""
        problems = {run.problem.name: run for run in self.curves}
        return {
            name: float(
                oracle_bounds(
                    trial_set(run.problem, run.protocol.trials, run.protocol.seed)
                ).reachable.mean()
            )
            for name, run in problems.items()
        }

    def rows(self) -> Iterator[dict[str, Any]]:
        """One row per problem and learner, as dictionaries that JSON can hold."""
        for series in self.series:
            yield {
                "problem": series.problem.name,
                "learner": series.learner.name,
                "seeds": len(series.curves),
                "success": series.success.to_json(),
                "success_each": [curve[-1].successes / series.trials for curve in series.curves],
                "collision": series.collision.to_json(),
                "median_distance": series.last("median_distance"),
                "steps_to_success": series.steps_to_success,
                "environment_steps": series.last("environment_steps"),
                "seconds": series.last("seconds"),
                "processor_seconds": series.last("processor_seconds"),
                "until": [
                    {
                        "success": level,
                        **{
                            quantity: _finite(series.until(level, quantity))
                            for quantity in ("environment_steps", "seconds", "processor_seconds")
                        },
                    }
                    for level in LEVELS
                ],
            }


def _finite(number: float) -> float | None:
    """None for what never happens: JSON has no infinity."""
    return number if math.isfinite(number) else None
