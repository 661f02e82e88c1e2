"""One training of an experiment: its run, its results and its file.

Functions that read a file raise `InvalidInputError` if it is missing, damaged or of another
training.
"""

import io
import math
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm._files import Archive, load_archive, reading, save_archive
from kinarm.episodes import Rollouts
from kinarm.errors import InvalidInputError
from kinarm.evaluation.experiments.curve import Clock, Curve, CurvePoint, CurveSoFar
from kinarm.evaluation.experiments.plan import Run
from kinarm.evaluation.trials import trial_set
from kinarm.policies.checkpoint import CHECKPOINT_SECONDS, rebuilt, save_checkpoint
from kinarm.policies.learners import CurvePoint as IterationPoint
from kinarm.policies.learners import TrainingState, state_policy, training_states
from kinarm.policies.policy import Policy, policy_content, policy_of_content

ARCHIVE = ("study run", 1)
"""Kind and version of the files."""

POLICY, OUTCOMES = "policy.", "outcomes."
"""Beginnings of names of arrays."""

KEPT = (
    *("distance", "steps", "returns", "success", "collision"),
    *("turn", "goals_reached", "interventions"),
)
"""Columns of `Rollouts` that are kept of the trials."""

LEFT_OUT = ("starts", "goals", "configurations", "targets", "moments", "paths")
"""Those that are not, and are empty where a file is read."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TrainedRun:
    """A finished training.

    Attributes
    ----------
    curve : tuple of CurvePoint
        The policy in the course of the training.
    last : CurvePoint
        The trained policy.
    outcomes : Rollouts
        The trained policy in every trial, without configurations and goals.
    returns : ndarray, shape (n_iterations,), optional
        Mean returns of each iteration; kept with trials for the curve.
    curve_distance : ndarray of float32, shape (n_points, n_curve_trials), optional
        Final distances at its points [m]; kept with trials for the curve.
    clock : Clock
        How long it took; empty if unknown.
    """

    curve: tuple[CurvePoint, ...]
    last: CurvePoint
    outcomes: Rollouts
    returns: NDArray[np.float64] | None = None
    curve_distance: NDArray[np.float32] | None = None
    clock: Clock = field(default_factory=Clock)

    @property
    def timed_curve(self) -> list[tuple[CurvePoint, float, float]]:
        """Points and end of the curve, with wall and processor times [s], or NaN."""
        clock, unknown = self.clock, (math.nan,) * len(self.curve)
        columns = [
            times if len(times) == len(self.curve) else unknown
            for times in (clock.points, clock.processor_points)
        ]
        timed = list(zip(self.curve, *columns, strict=True))
        if not self.curve or self.curve[-1].iteration < self.last.iteration:
            timed.append((self.last, clock.seconds, clock.processor_seconds))
        return timed


class Task(NamedTuple):
    """A training for an executor, from its state and learning curve, None for the beginning.

    It saves both in the checkpoint, if there is one and its folder exists.
    """

    run: Run
    state: Any = None
    curve: CurveSoFar = CurveSoFar()
    checkpoint: Path | None = None


class TaskResult(NamedTuple):
    """Result of a training from a worker.

    Attributes
    ----------
    content : bytes
        Content of the file of the run.
    clock, iterations : Clock and tuple
        How long it took, and its iterations.
    """

    content: bytes
    clock: Clock
    iterations: tuple[IterationPoint, ...]


def train(task: Task, threads: int = 1) -> TaskResult:
    """Train and evaluate; neither threads nor interruptions change the result."""
    run, begun, so_far, checkpoint = task
    config = run.config
    curve = Curve(config, run.trials, so_far)
    states = curve.timed(training_states(config, begun, threads))
    state = next(states)
    if begun is None:
        curve.update(state)
    place = checkpoint if checkpoint is not None and checkpoint.parent.is_dir() else None
    saved = time.monotonic()
    for state in states:
        curve.update(state)
        if place is not None and time.monotonic() - saved > CHECKPOINT_SECONDS:
            save_checkpoint(place, config, state, curve.so_far())
            saved = time.monotonic()
    so_far = curve.so_far()
    return TaskResult(_run_content(run, state, so_far), so_far.clock, state.curve)


def _run_content(run: Run, state: TrainingState, curve: CurveSoFar) -> bytes:
    """Content of the file of a training; equal ones give equal bytes."""
    policy, trials = state_policy(run.config, state), run.trials
    faced = trial_set(run.config.problem, trials.count, trials.seed)
    rollouts = faced.simulator.rollout(policy, faced.starts, faced.goals)
    content = policy_content(policy)
    arrays = {
        "curve": np.array(curve.points, dtype=float).reshape(-1, len(CurvePoint._fields)),
        **{OUTCOMES + name: getattr(rollouts, name) for name in KEPT},
        **{POLICY + name: array for name, array in content.arrays.items()},
    }
    if trials.curve is not None:
        arrays["returns"] = np.array([point.mean_return for point in state.curve])
        arrays["curve_distance"] = curve.distances
    # Where a file was made must not tell in its bytes.
    made = {**content.header["provenance"], "versions": {}, "commit": ""}
    header = {
        "settings": run.settings,
        "last": CurvePoint.of(state, rollouts)._asdict(),
        "policy": {**content.header, "provenance": made},
    }
    file = io.BytesIO()
    save_archive(file, *ARCHIVE, arrays, header, compress=True)
    return file.getvalue()


@contextmanager
def _content_of(path: Path, run: Run, unless: str) -> Iterator[Archive]:
    """Header and arrays of a training's file, ``unless`` their names begin so."""
    content = load_archive(path, *ARCHIVE, InvalidInputError, unless=(unless,))
    with reading(repr(str(path)), ARCHIVE[0], InvalidInputError):
        if content.header["settings"] != run.settings:
            raise InvalidInputError(f"{str(path)!r} is of another training")
        yield content


def load_policy(path: Path, run: Run) -> Policy:
    """Read the policy of a finished training."""
    with _content_of(path, run, OUTCOMES) as (header, arrays):
        archive = Archive(header["policy"], _parts(arrays, POLICY))
        return policy_of_content(archive, repr(str(path)))


def load_run(path: Path, run: Run, clock: Clock) -> TrainedRun:
    """Read the results of a training.

    Parameters
    ----------
    path, run : Path and Run
        The file, and the training.
    clock : Clock
        How long it took.
    """
    with _content_of(path, run, POLICY) as (header, arrays):
        empty: dict[str, Any] = dict.fromkeys(LEFT_OUT, np.empty(0))
        return TrainedRun(
            curve=rebuilt(tuple[CurvePoint, ...], "curve", arrays),
            last=CurvePoint(**header["last"]),
            outcomes=Rollouts(**empty, **_parts(arrays, OUTCOMES)),
            returns=arrays.get("returns"),
            curve_distance=arrays.get("curve_distance"),
            clock=clock,
        )


def _parts(arrays: Mapping[str, NDArray[Any]], begin: str) -> dict[str, NDArray[Any]]:
    """Arrays whose name begins so, by the rest of it."""
    return {
        name.removeprefix(begin): array for name, array in arrays.items() if name.startswith(begin)
    }
