"""Learning curves: the trials that policies face during a training."""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm._fields import Checked
from kinarm.episodes import Rollouts
from kinarm.errors import FROM_ZERO, TRIALS
from kinarm.evaluation.trials import trial_set
from kinarm.policies.config import TrainingConfig
from kinarm.policies.learners import TrainingState, state_policy

MOST_POINTS = 1000
"""Most points of a learning curve, or per decade of environment steps."""


@dataclass(frozen=True, kw_only=True)
class CurveTrials(Checked):
    """Separate trials for the learning curves.

    Files then also keep the final distance of every trial at every point of the
    curve, and the mean return of every iteration.

    Parameters
    ----------
    points : int
        Most times that a policy faces the trials during its training.
    spacing : {"even", "geometric"}
        Spacing of the iterations after which it does, the last included; with
        geometric spacing also before the first.
    count, seed : int
        Number and seed of the trials.
    """

    points: int = field(default=50, metadata={"at_most": MOST_POINTS})
    spacing: Literal["even", "geometric"] = "even"
    count: int = field(default=100, metadata=TRIALS)
    seed: int = field(default=1, metadata=FROM_ZERO)

    def iterations(self, last: int) -> frozenset[int]:
        """After which iterations there is a point."""
        if self.spacing == "even":
            ends = np.linspace(0, last, self.points + 1)[1:].clip(1)
        else:
            ends = np.append(0, np.geomspace(1, last, self.points))
        return frozenset(ends.round().astype(np.int64).tolist())


@dataclass(frozen=True, kw_only=True)
class TrialSettings(Checked):
    """Which trials the policies of an experiment face, and when.

    Parameters
    ----------
    count : int
        Trials that every policy faces.
    seed : int
        Seed of the trials.
    per_decade : int
        How often a policy faces them while its environment steps grow tenfold;
        0 for at the end alone.
    first : int
        Environment steps after which it first faces them.
    curve : CurveTrials, optional
        Other trials and times for the learning curves.
    """

    count: int = field(default=1000, metadata=TRIALS)
    seed: int = field(default=0, metadata=FROM_ZERO)
    per_decade: int = field(default=4, metadata={**FROM_ZERO, "at_most": MOST_POINTS})
    first: int = 10_000
    curve: CurveTrials | None = None


class CurvePoint(NamedTuple):
    """How the policy did at one point of a training.

    Attributes
    ----------
    iteration, environment_steps : int
        Finished iterations, and steps taken.
    success, collision : float
        Shares of the trials that ended so.
    median_distance : float
        Median of the final distances [m].
    """

    iteration: int
    environment_steps: int
    success: float
    collision: float
    median_distance: float

    @classmethod
    def of(cls, state: TrainingState, rollouts: Rollouts) -> "CurvePoint":
        """The point that rollouts of a policy make."""
        return cls(
            iteration=state.iteration,
            environment_steps=state.environment_steps,
            success=float(rollouts.success.mean()),
            collision=float(rollouts.collision.mean()),
            median_distance=float(np.median(rollouts.distance)),
        )


@dataclass(frozen=True)
class Clock:
    """How long a training took, without the trials of its policies.

    Attributes
    ----------
    seconds, processor_seconds : float
        Wall time and processor time [s]; NaN if unknown.
    points, processor_points : tuple of float
        The same at each point of the learning curve [s].
    """

    seconds: float = math.nan
    processor_seconds: float = math.nan
    points: tuple[float, ...] = ()
    processor_points: tuple[float, ...] = ()


@dataclass(frozen=True)
class Made(Clock):
    """The clock, the versions of packages and the commit of kinarm's source."""

    versions: dict[str, str] = field(default_factory=dict)
    commit: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class CurveSoFar:
    """A learning curve as it is kept beside the state of its training.

    Attributes
    ----------
    points : tuple of CurvePoint
        The policy during the training.
    distances : ndarray of float32, shape (n_points, n_trials), or empty
        Final distances at the points, if they are kept [m].
    clock : Clock
        Time of the training until now.
    """

    points: tuple[CurvePoint, ...] = ()
    distances: NDArray[np.float32] = field(default_factory=lambda: np.empty(0, np.float32))
    clock: Clock = Clock(0.0, 0.0)


class Curve:
    """The learning curve of a training under way, and its time."""

    def __init__(self, config: TrainingConfig, trials: TrialSettings, so_far: CurveSoFar) -> None:
        self._config, self._settings, clock = config, trials, so_far.clock
        self.points, self._distances = [*so_far.points], [*so_far.distances]
        self._spent = np.array([clock.seconds, clock.processor_seconds])
        self._times = [*zip(clock.points, clock.processor_points, strict=False)]
        own = trials.curve or trials
        self._trials = trial_set(config.problem, own.count, own.seed)
        first = self._trials.chosen([0])
        simulator = first.simulator
        actions = np.zeros((1, simulator.task.horizon, simulator.n_actions))
        simulator.rollout_actions(actions, first.starts, first.goals)  # before any clock runs

    def timed(self, states: Iterator[Any]) -> Iterator[Any]:
        """The states of the training; the time that they take is counted."""
        began = time.perf_counter(), time.process_time()
        for state in states:
            self._spent += np.subtract((time.perf_counter(), time.process_time()), began)
            yield state
            began = time.perf_counter(), time.process_time()

    def update(self, state: TrainingState) -> None:
        """Add a point and its time if one is due."""
        if not self._is_due(state):
            return
        policy, trials = state_policy(self._config, state), self._trials
        rollouts = trials.simulator.rollout(policy, trials.starts, trials.goals)
        self.points.append(CurvePoint.of(state, rollouts))
        self._times.append(tuple(self._spent.round(3).tolist()))
        if self._settings.curve is not None:
            self._distances.append(rollouts.distance.astype(np.float32))

    def _is_due(self, state: TrainingState) -> bool:
        """Whether a new point of the curve is reached."""
        settings = self._settings
        if settings.curve is not None:
            return state.iteration in settings.curve.iterations(self._config.iterations)
        if settings.per_decade == 0:
            return False
        last = self.points[-1].environment_steps if self.points else 0
        number = 0  # of the first point beyond the last one
        while last >= (due := settings.first * 10.0 ** (number / settings.per_decade)):
            number += 1
        return bool(state.environment_steps >= due)

    def so_far(self) -> CurveSoFar:
        """The curve until now."""
        times = tuple(zip(*self._times, strict=True)) or ((), ())
        clock = Clock(*self._spent.round(3).tolist(), *times)
        distances = np.array(self._distances, dtype=np.float32)
        return CurveSoFar(points=tuple(self.points), distances=distances, clock=clock)
