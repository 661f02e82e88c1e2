"""What a training came to, or has come to so far, and the files in which it is kept."""

import io
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm._archive import Archive, load_archive, reading, save_archive, write_archive
from kinarm.errors import InvalidInputError
from kinarm.evaluation.experiments.curve import CurvePoint, curve_array, points_of
from kinarm.evaluation.experiments.plan import Run
from kinarm.policies.checkpoint import arrays_of, rebuilt
from kinarm.policies.learners import TrainingState, find_learner
from kinarm.policies.policy import Policy
from kinarm.policies.policy_files import policy_content, policy_of_content

RUN_ARCHIVE, BOUNDS_ARCHIVE = ("study run", 1), ("study bounds", 1)
CHECKPOINT_ARCHIVE = ("study checkpoint", 1)
"""Kinds and versions of the files."""

STATE, POLICY, OUTCOMES = "state", "policy.", "outcomes."
"""What names of arrays begin with."""


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

    def __len__(self) -> int:
        return len(self.distance)


class TrialBounds(NamedTuple):
    """What any policy could do in every trial; arrays of shape (n_trials,).

    Attributes
    ----------
    reachable : ndarray of bool
        Whether the oracle found a motion to the goal.
    steps_lower_bound : ndarray of int
        Steps that are proven necessary.
    """

    reachable: NDArray[np.bool_]
    steps_lower_bound: NDArray[np.int64]


class Clock(NamedTuple):
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
    """What a training came to.

    Attributes
    ----------
    settings : mapping
        What was trained, as the planned run tells.
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
    policy : Policy, optional
        The trained policy, where it was read as well.
    state : TrainingState, optional
        Where a longer training can go on; kept if its iterations are those of this one.
    """

    settings: Mapping[str, Any]
    curve: tuple[CurvePoint, ...]
    last: CurvePoint
    outcomes: TrialOutcomes
    returns: NDArray[np.float64] | None = None
    curve_distance: NDArray[np.float32] | None = None
    policy: Policy | None = None
    state: TrainingState | None = None


class Checkpoint(NamedTuple):
    """A training under way, or the end of a shorter one, from which a longer one goes on.

    Attributes
    ----------
    state : TrainingState
        The state that it is in.
    curve : tuple of CurvePoint
        Its learning curve.
    distances : tuple of ndarray
        Final distances at the points of the curve, if they are kept [m].
    clock : Clock
        What it took.
    """

    state: TrainingState
    curve: tuple[CurvePoint, ...] = ()
    distances: tuple[NDArray[np.float32], ...] = ()
    clock: Clock = Clock()


def run_content(run: TrainedRun, policy: Policy) -> bytes:
    """A run and its policy as their file holds them; equal runs give equal bytes."""
    content = policy_content(policy)
    arrays = {
        "curve": curve_array(run.curve),
        **{OUTCOMES + name: array for name, array in run.outcomes._asdict().items()},
        **{POLICY + name: array for name, array in content.arrays.items()},
    }
    for name in ("returns", "curve_distance"):
        if getattr(run, name) is not None:
            arrays[name] = getattr(run, name)
    if run.state is not None:
        arrays |= arrays_of(STATE, timeless(run.state))
    # Where a file was made must not tell in its bytes.
    made = {**content.header["provenance"], "versions": {}, "commit": ""}
    header = {
        "settings": run.settings,
        "last": run.last._asdict(),
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
    write_archive(file, *archive, arrays, header, compress=True)
    return file.getvalue()


def load_bounds(path: Path, count: int) -> TrialBounds:
    """Read the file of bounds of so many trials.

    Raises
    ------
    InvalidInputError
        If it is missing or damaged.
    """
    arrays = load_archive(path, *BOUNDS_ARCHIVE, InvalidInputError).arrays
    with reading(repr(str(path)), BOUNDS_ARCHIVE[0], InvalidInputError):
        return TrialBounds(**_each_trials(arrays, BOUND_TYPES, count))


def save_checkpoint(path: Path, run: Run, checkpoint: Checkpoint) -> None:
    """Write how far a training is.

    Parameters
    ----------
    path : Path
        The file.
    run : Run
        The training.
    checkpoint : Checkpoint
        How far it is.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    arrays: dict[str, NDArray[Any]] = {
        "curve": curve_array(checkpoint.curve),
        "distances": np.array(checkpoint.distances),
        **arrays_of(STATE, checkpoint.state),
    }
    header = {"settings": run.settings, "clock": checkpoint.clock._asdict()}
    save_archive(path, *CHECKPOINT_ARCHIVE, arrays, header)


def load_checkpoint(path: Path, run: Run) -> Checkpoint:
    """Read how far a training is.

    Raises
    ------
    InvalidInputError
        If the file is missing, damaged or of another training.
    """
    header, arrays = load_archive(path, *CHECKPOINT_ARCHIVE, InvalidInputError)
    with reading(repr(str(path)), CHECKPOINT_ARCHIVE[0], InvalidInputError):
        _check_settings(path, header, run)
        return Checkpoint(
            state=rebuilt(find_learner(run.learner).state, STATE, arrays),
            curve=points_of(arrays["curve"]),
            distances=tuple(arrays["distances"]),
            clock=clock_of(header["clock"]),
        )


def clock_of(entries: Mapping[str, Any]) -> Clock:
    """Times from what JSON holds."""
    return Clock(
        float(entries.get("seconds", 0.0)),
        float(entries.get("processor_seconds", 0.0)),
        tuple(map(float, entries.get("points", ()))),
        tuple(map(float, entries.get("processor_points", ()))),
    )


def timeless(state: TrainingState) -> TrainingState:
    """A state without the times that its iterations took."""
    changes: dict[str, Any] = {"curve": tuple(p._replace(wall_time=0.0) for p in state.curve)}
    if hasattr(state, "simulator_time"):
        changes["simulator_time"] = 0.0
    return replace(state, **changes)


def run_of_file(path: Path) -> Run:
    """The training that a file is of; its place in an experiment is not known.

    Raises
    ------
    KinarmError
        If the file is missing or damaged, or its settings cannot be used.
    """
    every = (f"{STATE}.", POLICY, OUTCOMES, "curve", "returns")
    header, _ = load_archive(path, *RUN_ARCHIVE, InvalidInputError, unless=every)
    with reading(repr(str(path)), RUN_ARCHIVE[0], InvalidInputError):
        return Run.of_settings(header["settings"], str(path))


def load_run(path: Path, run: Run, *, whole: bool = False) -> TrainedRun:
    """Read the file of a run.

    Parameters
    ----------
    path : Path
        The file.
    run : Run
        The training that it is of.
    whole : bool
        Read policy and state as well.

    Raises
    ------
    InvalidInputError
        If it is missing, damaged or of another training.
    """
    unless = () if whole else (f"{STATE}.", POLICY)
    content = load_archive(path, *RUN_ARCHIVE, InvalidInputError, unless=unless)
    with reading(repr(str(path)), RUN_ARCHIVE[0], InvalidInputError):
        header, arrays = content
        _check_settings(path, header, run)
        policy, state = None, None
        if whole:
            archive = Archive(header["policy"], _parts(arrays, POLICY))
            policy = policy_of_content(archive, repr(str(path)))
        if any(name.startswith(f"{STATE}.") for name in arrays):
            state = rebuilt(find_learner(run.learner).state, STATE, arrays)
        outcomes = _each_trials(_parts(arrays, OUTCOMES), OUTCOME_TYPES, run.trials.count)
        return TrainedRun(
            settings=header["settings"],
            curve=points_of(arrays["curve"]),
            last=CurvePoint(**header["last"]),
            outcomes=TrialOutcomes(**outcomes),
            returns=arrays.get("returns"),
            curve_distance=arrays.get("curve_distance"),
            policy=policy,
            state=state,
        )


def _check_settings(path: Path, header: Mapping[str, Any], run: Run) -> None:
    if header["settings"] != run.settings:
        raise InvalidInputError(f"{str(path)!r} is of another training")


OUTCOME_TYPES = {"distance": "f8", "steps": "i8", "returns": "f8", "success": "?", "collision": "?"}
BOUND_TYPES = {"reachable": "?", "steps_lower_bound": "i8"}
"""Types of arrays with an entry for each trial: numbers, whole numbers and truth values."""

LARGEST = 1e12
"""Numbers of trials at most: sums and squares of them stay finite."""


def _each_trials(
    arrays: Mapping[str, NDArray[Any]], types: Mapping[str, str], count: int
) -> dict[str, NDArray[Any]]:
    """Arrays that are to have an entry for each of so many trials.

    Raises
    ------
    ValueError
        If one is missing, of another type or shape, or holds a number that is not finite or
        beyond what a trial comes to.
    """
    for name, type_ in types.items():
        array = arrays[name]
        if array.dtype != type_ or array.shape != (count,):
            raise ValueError(f"{name} is not of {count} trials")
        if type_ == "f8" and not (np.abs(array) <= LARGEST).all():
            raise ValueError(f"{name} holds a number that no trial comes to")
    return {name: arrays[name] for name in types}


def _parts(arrays: Mapping[str, NDArray[Any]], begin: str) -> dict[str, NDArray[Any]]:
    """Arrays whose name begins so, by the rest of it."""
    return {
        name.removeprefix(begin): array for name, array in arrays.items() if name.startswith(begin)
    }
