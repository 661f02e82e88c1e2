"""Learning curves: which trials policies face in the course of a training, when, and how."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from kinarm._fields import check_fields
from kinarm._validation import MOST_TRIALS, whole_number
from kinarm.episodes import Rollouts
from kinarm.policies.learners import TrainingState

MOST_POINTS = 1000
"""Points of a learning curve at most, or per decade of environment steps."""


@dataclass(frozen=True, kw_only=True)
class CurveTrials:
    """Trials of their own for the learning curves, whose files then keep more.

    That is, the final distance of every trial at every point of the curve, and the mean return of
    every iteration.

    Parameters
    ----------
    points : int
        How often a policy faces the trials in the course of its training, at most.
    spacing : {"even", "geometric"}
        How the iterations lie apart after which it does; the last is among them, and with geometric
        spacing it faces them before the first iteration as well.
    count, seed : int
        Number and seed of the trials.
    """

    points: int = 50
    spacing: Literal["even", "geometric"] = "even"
    count: int = 100
    seed: int = 1

    def __post_init__(self) -> None:
        check_fields(self)
        whole_number("points", self.points, 1, MOST_POINTS)
        whole_number("count", self.count, 1, MOST_TRIALS)
        whole_number("seed", self.seed, 0)

    def iterations(self, last: int) -> frozenset[int]:
        """After which iterations there is a point; the last is always among them."""
        if self.spacing == "even":
            ends = np.linspace(0, last, self.points + 1)[1:].clip(1)
        else:
            ends = np.append(0, np.geomspace(1, last, self.points))
        return frozenset(ends.round().astype(np.int64).tolist())


@dataclass(frozen=True, kw_only=True)
class TrialSettings:
    """Which trials the policies of an experiment face, and when.

    Parameters
    ----------
    count : int
        Trials that every policy faces.
    seed : int
        Seed of the trials.
    per_decade : int
        How often a policy faces them in the course of its training while the environment steps
        grow tenfold; 0 for at the end alone.
    first : int
        Environment steps after which it faces them for the first time.
    curve : CurveTrials, optional
        Other trials and times for the course of the training.
    """

    count: int = 1000
    seed: int = 0
    per_decade: int = 4
    first: int = 10_000
    curve: CurveTrials | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        whole_number("count", self.count, 1, MOST_TRIALS)
        whole_number("seed", self.seed, 0)
        whole_number("per_decade", self.per_decade, 0, MOST_POINTS)
        whole_number("first", self.first, 1)


class CurvePoint(NamedTuple):
    """How the policy did at one point of a training.

    Attributes
    ----------
    iteration, environment_steps : int
        Iterations that are finished, and steps taken.
    success, collision : float
        Shares of the trials that ended so.
    median_distance : float
        Of the final distances [m].
    """

    iteration: int
    environment_steps: int
    success: float
    collision: float
    median_distance: float

    @classmethod
    def of(cls, state: TrainingState, rollouts: Rollouts) -> "CurvePoint":
        """The point of the curve that rollouts of a policy make."""
        return cls(
            iteration=state.iteration,
            environment_steps=state.environment_steps,
            success=float(rollouts.success.mean()),
            collision=float(rollouts.collision.mean()),
            median_distance=float(np.median(rollouts.distance)),
        )
