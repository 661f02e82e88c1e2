"""Learning curves: which trials policies face in the course of a training, when, and how."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm._fields import check_fields
from kinarm._validation import MOST_TRIALS, whole_number
from kinarm.evaluation.trials import TrialSet, trial_set
from kinarm.policies.config import TrainingConfig
from kinarm.policies.learners import TrainingState, state_policy
from kinarm.policies.policy import Policy
from kinarm.rollouts import Rollouts

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
        """What rollouts of the policy of a state came to."""
        return cls(
            iteration=state.iteration,
            environment_steps=state.environment_steps,
            success=float(rollouts.success.mean()),
            collision=float(rollouts.collision.mean()),
            median_distance=float(np.median(rollouts.distance)),
        )


class Curve:
    """The learning curve of a training, as far as it is.

    Parameters
    ----------
    config : TrainingConfig
        The settings of the training.
    settings : TrialSettings
        Which trials its policies face, and when.
    points : sequence of CurvePoint
        The points so far.
    distances : sequence of ndarray
        Final distances of the trials at these points, if they are kept [m].

    Attributes
    ----------
    points : list of CurvePoint
        How the policy did.
    distances : list of ndarray of float32, shape (n_trials,)
        Final distances at the points [m]; none unless the settings have trials for the curve.
    """

    def __init__(
        self,
        config: TrainingConfig,
        settings: TrialSettings,
        points: Sequence[CurvePoint] = (),
        distances: Sequence[NDArray[np.float32]] = (),
    ) -> None:
        self.points, self.distances = [*points], [*distances]
        self._config, self._settings = config, settings
        own = settings.curve or settings
        self._trials = trial_set(config.problem, own.count, own.seed)
        self._iterations = _due_iterations(settings.curve, config.iterations)
        first = self._trials.chosen([0])
        simulator = first.simulator
        actions = np.zeros((1, simulator.task.horizon, simulator.n_actions))
        simulator.rollout_actions(actions, first.starts, first.goals)  # before any clock runs

    def update(self, state: TrainingState) -> bool:
        """Add a point if it is time for one; whether it was."""
        if not self._is_due(state):
            return False
        rollouts = face(state_policy(self._config, state), self._trials)
        self.points.append(CurvePoint.of(state, rollouts))
        if self._settings.curve is not None:
            self.distances.append(rollouts.distance.astype(np.float32))
        return True

    def _is_due(self, state: TrainingState) -> bool:
        """Whether a point of the curve is reached that was not reached before."""
        if self._settings.curve is not None:
            return state.iteration in self._iterations
        if self._settings.per_decade == 0:
            return False
        last = self.points[-1].environment_steps if self.points else 0
        return self._reached(state.environment_steps) > self._reached(last)

    def _reached(self, environment_steps: int) -> int:
        """How many points there are up to a number of steps."""
        settings, number = self._settings, 0
        while environment_steps >= settings.first * 10.0 ** (number / settings.per_decade):
            number += 1
        return number


def _due_iterations(curve: CurveTrials | None, iterations: int) -> frozenset[int]:
    """After which iterations there is a point; the last is always among them."""
    if curve is None:
        return frozenset()
    if curve.spacing == "even":
        ends = np.linspace(0, iterations, curve.points + 1)[1:].clip(1)
    else:
        ends = np.append(0, np.geomspace(1, iterations, curve.points))
    return frozenset(ends.round().astype(np.int64).tolist())


def face(policy: Policy, trials: TrialSet) -> Rollouts:
    """Put a policy to trials."""
    return trials.simulator.rollout(policy, trials.starts, trials.goals)


def curve_array(points: Sequence[CurvePoint]) -> NDArray[np.float64]:
    """Points as rows of numbers, shape (n_points, 5)."""
    return np.array(points, dtype=np.float64).reshape(-1, len(CurvePoint._fields))


def points_of(array: NDArray[np.float64]) -> tuple[CurvePoint, ...]:
    """The points that `curve_array` made rows of."""
    return tuple(CurvePoint(int(row[0]), int(row[1]), *row[2:]) for row in array.tolist())
