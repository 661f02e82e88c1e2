"""What a training came to, and the file in which it is kept."""

import io
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm._archive import Archive, load_archive, reading, write_archive
from kinarm._fields import from_plain
from kinarm.errors import InvalidInputError
from kinarm.evaluation.studies.planning import PlannedRun
from kinarm.evaluation.studies.specification import StudyTrials
from kinarm.policies.checkpoint import arrays_of, rebuilt
from kinarm.policies.learners import TrainingState, find_learner
from kinarm.policies.policy import Policy
from kinarm.policies.policy_files import policy_content, policy_of_content

ARCHIVE, BOUNDS_ARCHIVE = ("study run", 1), ("study bounds", 1)
"""Kinds and versions of the files."""

STATE, POLICY, OUTCOMES = "state", "policy.", "outcomes."
"""What names of arrays begin with."""


class RunPoint(NamedTuple):
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


class RunClock(NamedTuple):
    """How long a training took, apart from everything that must be the same each time.

    Attributes
    ----------
    seconds : float
        Wall time of the training, without judging [s].
    processor_seconds : float
        Processor time of the whole run, judging included [s].
    points : tuple of float
        Wall time of the training at each point of the learning curve [s].
    """

    seconds: float = 0.0
    processor_seconds: float = 0.0
    points: tuple[float, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class TrainedRun:
    """What a training came to.

    Attributes
    ----------
    settings : mapping
        What was trained, as the planned run tells.
    curve : tuple of RunPoint
        The policy in the course of the training, as often as the trials say.
    last : RunPoint
        The trained policy.
    outcomes : TrialOutcomes
        The trained policy in every trial.
    """

    settings: Mapping[str, Any]
    curve: tuple[RunPoint, ...]
    last: RunPoint
    outcomes: TrialOutcomes


@dataclass(frozen=True, kw_only=True, eq=False)
class WholeRun(TrainedRun):
    """What a training came to, and what it left.

    Attributes
    ----------
    policy : Policy
        The trained policy.
    state : TrainingState or None
        Where a longer training can go on; kept if its iterations are those of this one.
    """

    policy: Policy
    state: TrainingState | None = None


def run_content(run: WholeRun) -> bytes:
    """A run as its file holds it; equal runs give equal bytes."""
    policy = policy_content(run.policy)
    arrays = {
        "curve": np.array(run.curve, dtype=np.float64).reshape(-1, len(RunPoint._fields)),
        **{OUTCOMES + name: array for name, array in run.outcomes._asdict().items()},
        **{POLICY + name: array for name, array in policy.arrays.items()},
    }
    if run.state is not None:
        arrays |= arrays_of(STATE, timeless(run.state))
    # Where a file was made must not tell in its bytes.
    made = {**policy.header["provenance"], "versions": {}, "commit": ""}
    header = {
        "settings": run.settings,
        "last": run.last._asdict(),
        "policy": {**policy.header, "provenance": made},
    }
    file = io.BytesIO()
    write_archive(file, *ARCHIVE, arrays, header, compress=True)
    return file.getvalue()


def bounds_content(bounds: TrialBounds) -> bytes:
    """Bounds as their file holds them."""
    file = io.BytesIO()
    write_archive(file, *BOUNDS_ARCHIVE, bounds._asdict(), {}, compress=True)
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


def timeless(state: TrainingState) -> TrainingState:
    """A state without the times that its iterations took."""
    changes: dict[str, Any] = {"curve": tuple(p._replace(wall_time=0.0) for p in state.curve)}
    if hasattr(state, "simulator_time"):
        changes["simulator_time"] = 0.0
    return replace(state, **changes)


def planned_run(path: Path) -> PlannedRun:
    """The training that a file is of; what of it varied in its study is not known.

    Raises
    ------
    KinarmError
        If the file is missing or damaged, or its settings cannot be used.
    """
    arrays = (f"{STATE}.", POLICY, OUTCOMES)
    header, _ = load_archive(path, *ARCHIVE, InvalidInputError, unless=arrays)
    with reading(repr(str(path)), ARCHIVE[0], InvalidInputError):
        settings = header["settings"]
        config = from_plain(find_learner(settings["learner"]).config, settings["config"], str(path))
        trials = from_plain(StudyTrials, settings["trials"], str(path))
        return PlannedRun(config=config, trials=trials, choices={})


def load_run(path: Path, planned: PlannedRun) -> TrainedRun:
    """Read the file of a run, but for policy and state.

    Raises
    ------
    InvalidInputError
        If it is missing, damaged or of another training.
    """
    content = load_archive(path, *ARCHIVE, InvalidInputError, unless=(f"{STATE}.", POLICY))
    with reading(repr(str(path)), ARCHIVE[0], InvalidInputError):
        return TrainedRun(**_results(path, planned, content))


def load_whole_run(path: Path, planned: PlannedRun) -> WholeRun:
    """Read the file of a run; raises as `load_run` does."""
    content = load_archive(path, *ARCHIVE, InvalidInputError)
    with reading(repr(str(path)), ARCHIVE[0], InvalidInputError):
        header, arrays = content
        policy, state = Archive(header["policy"], _parts(arrays, POLICY)), None
        if any(name.startswith(f"{STATE}.") for name in arrays):
            state = rebuilt(find_learner(planned.learner).state, STATE, arrays)
        return WholeRun(
            **_results(path, planned, content),
            policy=policy_of_content(policy, repr(str(path))),
            state=state,
        )


def _results(path: Path, planned: PlannedRun, content: Archive) -> dict[str, Any]:
    """What a file says of what a training came to."""
    header, arrays = content
    if header["settings"] != planned.settings:
        raise InvalidInputError(f"{str(path)!r} is of another training")
    outcomes = _parts(arrays, OUTCOMES)
    return {
        "settings": header["settings"],
        "curve": tuple(_point(row) for row in arrays["curve"].tolist()),
        "last": RunPoint(**header["last"]),
        "outcomes": TrialOutcomes(**_each_trials(outcomes, OUTCOME_TYPES, planned.trials.count)),
    }


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


def _point(row: list[float]) -> RunPoint:
    iteration, steps, *rest = row
    return RunPoint(int(iteration), int(steps), *rest)


def _parts(arrays: Mapping[str, NDArray[Any]], begin: str) -> dict[str, NDArray[Any]]:
    """Arrays whose name begins so, by the rest of it."""
    return {
        name.removeprefix(begin): array for name, array in arrays.items() if name.startswith(begin)
    }
