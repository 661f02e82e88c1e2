"""Checkpoints of a training, from which it resumes exactly."""

import json
import math
from collections.abc import Iterable
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from kinarm._fields import from_plain, to_plain
from kinarm._files import Arrays, load_archive, reading, save_archive
from kinarm.errors import InvalidInputError, PolicyFileError
from kinarm.policies.config import TrainingConfig
from kinarm.policies.learners import TrainingState, find_learner

T = TypeVar("T")

ARCHIVE = ("checkpoint", 3)
"""Kind and version of the files."""

CHECKPOINT_SECONDS = 5.0
"""Time between checkpoints of a training [s]."""


class Checkpoint(NamedTuple):
    """An unfinished training: its settings, and the state to go on from."""

    config: Any
    state: Any


class Progress(NamedTuple):
    """How far a training is: the share of its iterations, and figures of the latest."""

    share: float
    mean_return: float = math.nan
    success: float = math.nan


def save_checkpoint(
    path: str | Path, config: TrainingConfig, state: TrainingState, beside: Any = None
) -> None:
    """Write the state of a training; only a complete file replaces an earlier one.

    Parameters
    ----------
    path : str or Path
        The file, ``.npz`` without pickle.
    config, state : TrainingConfig and TrainingState
        Settings and state of the training.
    beside : dataclass, optional
        What else is kept beside the state, such as a curve so far.
    """
    header = {
        "learner": config.learner,
        "config": to_plain(config),
        "arm_digest": config.problem.arm_digest,
        "iteration": state.iteration,
        "latest": [(point.mean_return, point.success) for point in state.curve[-1:]],
    }
    arrays = arrays_of("state", state)
    if beside is not None:
        arrays |= arrays_of("beside", beside)
    save_archive(path, *ARCHIVE, arrays, header)


def load_checkpoint(path: str | Path) -> Checkpoint:
    """Read what `save_checkpoint` wrote.

    Raises
    ------
    PolicyFileError
        If the file is missing, truncated or not a checkpoint, or the arm has
        changed.
    """
    header, arrays = load_archive(path, *ARCHIVE, PolicyFileError)
    name = repr(str(path))
    with reading(name, "checkpoint", PolicyFileError):
        learner = find_learner(header["learner"])
        config = from_plain(learner.config, header["config"], "settings")
        state = rebuilt(learner.state, "state", arrays)
        arm_digest = header["arm_digest"]
    if config.problem.arm_digest != arm_digest:
        raise PolicyFileError(
            f"arm {config.problem.arm.name!r} has changed since {name} was written"
        )
    return Checkpoint(config, state)


def load_beside(path: Path, kind: type[T]) -> T:
    """Read what a checkpoint holds beside the state."""
    _, arrays = load_archive(path, *ARCHIVE, PolicyFileError, unless=("state.",))
    with reading(repr(str(path)), "checkpoint", PolicyFileError):
        value: T = rebuilt(kind, "beside", arrays)
        return value


def load_progress(path: Path) -> Progress:
    """Read how far the training is."""
    header, _ = load_archive(path, *ARCHIVE, PolicyFileError, unless=("state.", "beside."))
    with reading(repr(str(path)), "checkpoint", PolicyFileError):
        share = header["iteration"] / header["config"]["iterations"]
        return Progress(share, *(number for latest in header["latest"] for number in latest))


def arrays_of(name: str, value: Any) -> dict[str, NDArray[Any]]:
    """Flatten a value into arrays with names such as ``state.theta``.

    Dictionaries become JSON, tuples of numbers or named tuples tables.
    """
    if is_dataclass(value) or hasattr(value, "_fields"):
        parts = [(part, getattr(value, part)) for part in _field_names(type(value))]
        return {k: v for part, item in parts for k, v in arrays_of(f"{name}.{part}", item).items()}
    if isinstance(value, dict):
        return {name: np.array(json.dumps(value, sort_keys=True))}
    return {name: np.array(value)}


def rebuilt(kind: Any, name: str, arrays: Arrays) -> Any:
    """Rebuild what `arrays_of` flattened.

    Raises InvalidInputError if an array has another type, or numbers that are not finite.

    Parameters
    ----------
    kind : type
        Type of the value, or the annotation of a field.
    name : str
        Name that its arrays have, or begin with.
    arrays : mapping of str to ndarray
        All arrays, of any shape.
    """
    if is_dataclass(kind) or hasattr(kind, "_fields"):
        hints = get_type_hints(kind)
        # What has a default was not always written.
        missing = [n for n in getattr(kind, "_field_defaults", ()) if f"{name}.{n}" not in arrays]
        names = [each for each in _field_names(kind) if each not in missing]
        return kind(**{part: rebuilt(hints[part], f"{name}.{part}", arrays) for part in names})
    if get_origin(kind) is tuple:
        record = get_args(kind)[0]
        if record is float:
            return tuple(arrays[name].tolist())
        types = get_type_hints(record).values()
        rows = arrays[name].reshape(-1, len(types)).tolist()
        return tuple(record(*(t(x) for t, x in zip(types, row, strict=True))) for row in rows)
    if get_origin(kind) is dict:
        return json.loads(str(arrays[name]))
    array = arrays[name]
    if kind in (int, float):
        return kind(array)
    wanted = get_args(get_args(kind)[1])[0]
    if array.dtype != wanted or not np.isfinite(array).all():
        raise InvalidInputError(f"{name} must be finite {wanted.__name__}")
    return array


def _field_names(kind: Any) -> Iterable[str]:
    """Names of saved fields of a dataclass or named tuple."""
    if not is_dataclass(kind):
        return tuple(kind._fields)
    return [item.name for item in fields(kind) if "unsaved" not in item.metadata]
