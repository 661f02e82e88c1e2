"""Results of a training, finished or so far, and the files in which they are kept.

Each function that reads a file raises `InvalidInputError` where it is missing or damaged, or of
another training.
"""

import io
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm._archive import Archive, load_archive, reading, save_archive
from kinarm._fields import from_plain, to_plain
from kinarm.episodes import Rollouts
from kinarm.errors import InvalidInputError
from kinarm.evaluation.experiments.curve import CurvePoint
from kinarm.evaluation.experiments.plan import Run
from kinarm.policies.checkpoint import arrays_of, rebuilt
from kinarm.policies.learners import TrainingState, find_learner
from kinarm.policies.policy import Policy, policy_content, policy_of_content

RUN_ARCHIVE, BOUNDS_ARCHIVE = ("study run", 1), ("study bounds", 1)
CHECKPOINT_ARCHIVE = ("study checkpoint", 1)
"""Kinds and versions of the files."""

STATE, POLICY, OUTCOMES = "state", "policy.", "outcomes."
"""Beginnings of the names of arrays."""


TimedPoint = tuple[CurvePoint, float, float]
"""A point of a learning curve with wall time and processor time [s]; NaN if unknown."""


class TrialOutcomes(NamedTuple):
    """How the trained policy did in every trial; arrays of shape (n_trials,).

    Attributes
    ----------
    distance : ndarray
        Final distances [m].
    steps : ndarray of int
        Steps taken.
    returns : ndarray
        Sums of rewards.
    success, collision : ndarray of bool
        How the trials ended.
    """

    distance: NDArray[np.float64]
    steps: NDArray[np.int64]
    returns: NDArray[np.float64]
    success: NDArray[np.bool_]
    collision: NDArray[np.bool_]


class TrialBounds(NamedTuple):
    """Bounds on any policy in every trial; arrays of shape (n_trials,).

    Attributes
    ----------
    reachable : ndarray of bool
        Whether the oracle found a motion to the goal.
    steps_lower_bound : ndarray of int
        Steps that are proven necessary.
    """

    reachable: NDArray[np.bool_]
    steps_lower_bound: NDArray[np.int64]


@dataclass(frozen=True)
class Clock:
    """How long a training took, without the trials that its policies faced.

    Attributes
    ----------
    seconds, processor_seconds : float
        Wall time, and time of all processors [s].
    points, processor_points : tuple of float
        The same at each point of the learning curve [s].
    """

    seconds: float = 0.0
    processor_seconds: float = 0.0
    points: tuple[float, ...] = ()
    processor_points: tuple[float, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class TrainedRun:
    """A finished training.

    Attributes
    ----------
    curve : tuple of CurvePoint
        The policy in the course of the training, as often as the settings of the trials say.
    last : CurvePoint
        The trained policy.
    outcomes : TrialOutcomes
        The trained policy in every trial.
    returns : ndarray, shape (n_iterations,), optional
        Mean returns of the episodes of each iteration; kept with trials for the curve.
    curve_distance : ndarray of float32, shape (n_points, n_curve_trials), optional
        Final distances at the points of the curve [m]; kept with trials for the curve.
    clock : Clock
        How long it took; nothing if unknown.
    """

    curve: tuple[CurvePoint, ...]
    last: CurvePoint
    outcomes: TrialOutcomes
    returns: NDArray[np.float64] | None = None
    curve_distance: NDArray[np.float32] | None = None
    clock: Clock = Clock()

    @property
    def timed_curve(self) -> list[TimedPoint]:
        """Points of the learning curve, the end included, with wall and processor times [s]."""
        clock, unknown = self.clock, (math.nan,) * len(self.curve)
        columns = [
            times if len(times) == len(self.curve) else unknown
            for times in (clock.points, clock.processor_points)
        ]
        timed = list(zip(self.curve, *columns, strict=True))
        if not self.curve or self.curve[-1].iteration < self.last.iteration:
            known = clock.seconds or math.nan, clock.processor_seconds or math.nan
            timed.append((self.last, *known))
        return timed


class Checkpoint(NamedTuple):
    """A training under way, or the end of a shorter one, from which a longer one goes on.

    Attributes
    ----------
    state, clock : TrainingState and Clock
        The state that it is in, and what it took.
    curve, distances : tuple of CurvePoint and of ndarray
        Its learning curve, and final distances at the points of it, if they are kept [m].
    """

    state: TrainingState
    curve: tuple[CurvePoint, ...] = ()
    distances: tuple[NDArray[np.float32], ...] = ()
    clock: Clock = Clock()


def run_content(run: Run, end: Checkpoint, policy: Policy, rollouts: Rollouts) -> bytes:
    """A finished training as its file holds it; equal ones give equal bytes.

    Parameters
    ----------
    run, end : Run and Checkpoint
        The training, and how it ended.
    policy, rollouts : Policy and Rollouts
        The trained policy, and what it did in the trials.
    """
    content = policy_content(policy)
    arrays = {
        "curve": np.array(end.curve, dtype=float).reshape(-1, len(CurvePoint._fields)),
        **{OUTCOMES + name: getattr(rollouts, name) for name in TrialOutcomes._fields},
        **{POLICY + name: array for name, array in content.arrays.items()},
    }
    if run.trials.curve is not None:
        arrays["returns"] = np.array([point.mean_return for point in end.state.curve])
        arrays["curve_distance"] = np.array(end.distances)
    if run.config.can_extend:
        arrays |= arrays_of(STATE, _timeless(end.state))
    # Where a file was made must not tell in its bytes.
    made = {**content.header["provenance"], "versions": {}, "commit": ""}
    header = {
        "settings": run.settings,
        "last": CurvePoint.of(end.state, rollouts)._asdict(),
        "policy": {**content.header, "provenance": made},
    }
    return _content(RUN_ARCHIVE, arrays, header)


def bounds_content(bounds: TrialBounds) -> bytes:
    """Bounds as their file holds them."""
    return _content(BOUNDS_ARCHIVE, bounds._asdict(), {})


def _content(
    archive: tuple[str, int], arrays: Mapping[str, NDArray[Any]], header: Mapping[str, Any]
) -> bytes:
    file = io.BytesIO()
    save_archive(file, *archive, arrays, header, compress=True)
    return file.getvalue()


def _timeless(state: TrainingState) -> TrainingState:
    """A state without the times that its iterations took."""
    changes: dict[str, Any] = {"curve": tuple(p._replace(wall_time=0.0) for p in state.curve)}
    if hasattr(state, "simulator_time"):
        changes["simulator_time"] = 0.0
    return replace(state, **changes)


@contextmanager
def _content_of(
    path: Path, archive: tuple[str, int], run: Run | None = None, *, unless: tuple[str, ...] = ()
) -> Iterator[Archive]:
    """Header and arrays of a file, which may have to be that of a training."""
    content = load_archive(path, *archive, InvalidInputError, unless=unless)
    with reading(repr(str(path)), archive[0], InvalidInputError):
        if run is not None and content.header["settings"] != run.settings:
            raise InvalidInputError(f"{str(path)!r} is of another training")
        yield content


def load_bounds(path: Path) -> TrialBounds:
    """Read the file of bounds."""
    with _content_of(path, BOUNDS_ARCHIVE) as (_, arrays):
        return TrialBounds(**arrays)


def save_checkpoint(path: Path, run: Run, checkpoint: Checkpoint) -> None:
    """Write how far a training is.

    Parameters
    ----------
    path, run, checkpoint : Path, Run and Checkpoint
        The file, the training, and how far it is.
    """
    arrays: dict[str, NDArray[Any]] = {
        **arrays_of("curve", checkpoint.curve),
        "distances": np.array(checkpoint.distances),
        **arrays_of(STATE, checkpoint.state),
    }
    header = {"settings": run.settings, "clock": to_plain(checkpoint.clock)}
    header["iteration"] = checkpoint.state.iteration
    save_archive(path, *CHECKPOINT_ARCHIVE, arrays, header)


def load_checkpoint(path: Path, run: Run) -> Checkpoint:
    """Read how far a training is."""
    with _content_of(path, CHECKPOINT_ARCHIVE, run) as (header, arrays):
        return Checkpoint(
            state=rebuilt(find_learner(run.learner).state, STATE, arrays),
            curve=_points(arrays),
            distances=tuple(arrays["distances"]),
            clock=from_plain(Clock, header["clock"], "record"),
        )


def load_share(path: Path) -> float:
    """Read from a checkpoint which share of the iterations is done."""
    every = (STATE, "curve", "distances")
    with _content_of(path, CHECKPOINT_ARCHIVE, unless=every) as (header, _):
        return float(header["iteration"] / header["settings"]["config"]["iterations"])


def load_settings(path: Path) -> dict[str, Any]:
    """Read the settings of the training that a file is of."""
    every = (STATE, POLICY, OUTCOMES, "curve", "returns")
    with _content_of(path, RUN_ARCHIVE, unless=every) as (header, _):
        settings: dict[str, Any] = header["settings"]
        return settings


def load_end(path: Path, learner: str, clock: Clock) -> Checkpoint:
    """Read the end of a training from which a longer one can go on.

    Parameters
    ----------
    path, learner : Path and str
        The file, and the name of the learner.
    clock : Clock
        How long the training took.
    """
    with _content_of(path, RUN_ARCHIVE, unless=(POLICY, OUTCOMES)) as (_, arrays):
        state = rebuilt(find_learner(learner).state, STATE, arrays)
        distances = tuple(arrays.get("curve_distance", ()))
        return Checkpoint(state, _points(arrays), distances, clock)


def load_policy(path: Path, run: Run) -> Policy:
    """Read the policy of a finished training."""
    with _content_of(path, RUN_ARCHIVE, run, unless=(STATE, OUTCOMES)) as (header, arrays):
        archive = Archive(header["policy"], _parts(arrays, POLICY))
        return policy_of_content(archive, repr(str(path)))


def load_run(path: Path, run: Run, clock: Clock) -> TrainedRun:
    """Read what a training came to.

    Parameters
    ----------
    path, run : Path and Run
        The file, and the training.
    clock : Clock
        How long the training took.
    """
    with _content_of(path, RUN_ARCHIVE, run, unless=(STATE, POLICY)) as (header, arrays):
        return TrainedRun(
            curve=_points(arrays),
            last=CurvePoint(**header["last"]),
            outcomes=TrialOutcomes(**_parts(arrays, OUTCOMES)),
            returns=arrays.get("returns"),
            curve_distance=arrays.get("curve_distance"),
            clock=clock,
        )


def _points(arrays: Mapping[str, NDArray[Any]]) -> tuple[CurvePoint, ...]:
    """Points of the learning curve."""
    points: tuple[CurvePoint, ...] = rebuilt(tuple[CurvePoint, ...], "curve", arrays)
    return points


def _parts(arrays: Mapping[str, NDArray[Any]], begin: str) -> dict[str, NDArray[Any]]:
    """Arrays whose name begins so, by the rest of it."""
    return {
        name.removeprefix(begin): array for name, array in arrays.items() if name.startswith(begin)
    }
