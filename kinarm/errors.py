"""Errors that kinarm raises on purpose, and checks of arguments that raise them.

::

    KinarmError
    ├── ArmError, ProblemError
    ├── PolicyFileError, RecordingFileError, OutputError
    ├── InvalidInputError, which is a ValueError
    │   └── UnknownNameError
    ├── StartInContactError, MissingExtraError
    └── WorkerError, TrainingFailedError, NoPathError, RunStoppedError

Command lines turn them into one line on standard error and exit status 2, or 1 for the last four,
failures of a run.
"""

import copyreg
import math
from collections.abc import Collection, Iterable, Mapping
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

LONGEST = 1500
"""Characters of a message; longer ones lose their middle."""

MOST_TRIALS = 10_000_000
"""Largest number of trials of a set: memory grows with it."""

FROM_ZERO: Mapping[str, Any] = {"at_least": 0}
TRIALS: Mapping[str, Any] = {"at_most": MOST_TRIALS}
POSITIVE = {"must": "be greater than 0", "holds": lambda value: value > 0}
NOT_NEGATIVE = {"must": "not be negative", "holds": lambda value: value >= 0}
SHARE = {"must": "lie in [0, 1]", "holds": lambda value: 0 <= value <= 1}
POSITIVE_SHARE = {"must": "lie in (0, 1]", "holds": lambda value: 0 < value <= 1}
"""Ranges of numbers: metadata of fields."""

LARGEST = 1e6
"""Largest number in settings [m or any unit], against overflows of parameters."""


def one_line(text: str) -> str:
    """A message as one line, cut in the middle if very long."""
    line = " ".join(text.split())
    if len(line) <= LONGEST:
        return line
    return f"{line[: LONGEST // 2]} ... {line[-LONGEST // 2 :]}"


class KinarmError(Exception):
    """Base of kinarm's own errors, whose messages are one line."""

    exit_status = 2
    """Exit status of a command."""

    def __str__(self) -> str:
        return one_line(super().__str__())

    def __reduce__(self) -> tuple[Any, ...]:
        # Made anew from message and attributes, whatever the constructor takes.
        return copyreg.__newobj__, (type(self), *self.args), vars(self)  # type: ignore[attr-defined]


class ArmError(KinarmError):
    """A robot description is missing, malformed or not supported."""


class ProblemError(KinarmError):
    """A problem is inconsistent, unexpected, or without contact-free starts."""


class InvalidInputError(KinarmError, ValueError):
    """An argument has the wrong shape or range, or is not finite."""


class UnknownNameError(InvalidInputError):
    """A name does not exist.

    Parameters
    ----------
    kind, given : str
        What was looked up, such as ``"task"``, and the given name.
    available : iterable of str
        Existing names.
    """

    def __init__(self, kind: str, given: str, available: Iterable[str]) -> None:
        self.kind, self.given, self.available = kind, given, tuple(available)
        super().__init__(
            f"unknown {kind} {given!r}{meant(given, self.available)}; "
            f"available: {', '.join(self.available) or 'none'}"
        )


def check_known(kind: str, given: Iterable[str], available: Collection[str]) -> None:
    """Refuse the first of the given names that is not available with `UnknownNameError`."""
    for name in given:
        if name not in available:
            raise UnknownNameError(kind, name, available)


def meant(given: str, available: Iterable[str]) -> str:
    """Suggest the most similar of the available names, if one is similar."""
    from difflib import get_close_matches

    names = [name for name in available if "/" not in name]  # the others stand for paths
    similar = get_close_matches(given, names, 1)
    return f" (did you mean {similar[0]!r}?)" if similar else ""


class StartInContactError(KinarmError):
    """A start configuration touches the ground, a bench or the arm itself.

    Parameters
    ----------
    index : int
        Position of the start in the given batch.
    pair : tuple of str
        Names of the two bodies in contact.
    """

    def __init__(self, index: int, pair: tuple[str, str]) -> None:
        super().__init__(f"start {index} is in contact: {pair[0]} touches {pair[1]}")


class PolicyFileError(KinarmError):
    """A policy file is missing, truncated, foreign, too new, or does not fit."""


class RecordingFileError(KinarmError):
    """A file of recordings is missing, truncated, foreign or too new."""


class OutputError(KinarmError):
    """A file or folder cannot be written."""


class WorkerError(KinarmError):
    """A worker process ended unexpectedly."""

    exit_status = 1


class TrainingFailedError(KinarmError):
    """Trainings of an experiment failed; the others are finished.

    Parameters
    ----------
    reasons : mapping of str to str
        Reasons of a line, by the trainings' names.
    trainings : int
        Trainings of the experiment.
    """

    exit_status = 1

    def __init__(self, reasons: Mapping[str, str], trainings: int) -> None:
        told = "; ".join(f"{name}: {reason}" for name, reason in reasons.items())
        super().__init__(f"{len(reasons)} of {trainings} trainings failed: {told}")


class NoPathError(KinarmError):
    """No path without contact was found, which proves nothing.

    Parameters
    ----------
    samples : int
        Samples that were tried.
    """

    exit_status = 1

    def __init__(self, samples: int) -> None:
        many = "1 sample" if samples == 1 else f"{samples} samples"
        super().__init__(f"no path found with {many}: there may be none")


class RunStoppedError(KinarmError):
    """A run on an arm was stopped, or the arm does not answer."""

    exit_status = 1


class MissingExtraError(KinarmError):
    """An optional package is not installed.

    Parameters
    ----------
    package, extra : str
        What is missing, and kinarm's extra that brings it.
    """

    def __init__(self, package: str, extra: str) -> None:
        super().__init__(f"{package} is not installed: pip install 'kinarm[{extra}]'")


def needed(module: str, package: str, extra: str) -> Any:
    """Import a module of a package that an extra of kinarm brings, or raise `MissingExtraError`."""
    try:
        return import_module(module)
    except ImportError as error:
        raise MissingExtraError(package, extra) from error


def finite_array(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """Copy an argument into a contiguous float64 array, or refuse it.

    Parameters
    ----------
    name, value
        Name of the argument for messages, and its value.
    shape : tuple
        Its required shape, with None for any length.
    """
    try:
        array = np.array(value, dtype=np.float64, order="C")
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidInputError(f"{name} must be numbers: {error}") from error
    if array.shape != shape and (
        array.ndim != len(shape)
        or any(want not in (None, has) for want, has in zip(shape, array.shape, strict=True))
    ):
        wanted = ", ".join("n" if length is None else str(length) for length in shape)
        raise InvalidInputError(f"{name} must have shape ({wanted}), got {array.shape}")
    if not np.isfinite(array).all():
        where = np.argwhere(~np.isfinite(array))[0].tolist()
        raise InvalidInputError(f"{name} must be finite, got {array[tuple(where)]} at {where}")
    return array


def one_or_many(
    name: str, value: ArrayLike, shape: tuple[int, ...]
) -> tuple[NDArray[np.float64], bool]:
    """Copy one item of a shape, or n of them, into an array of n; tell if it was one.

    Parameters
    ----------
    name, value, shape
        As for `finite_array`; the shape is that of an item.
    """
    try:
        one = np.ndim(value) == len(shape)
    except ValueError:
        one = False
    if one:
        return finite_array(name, value, shape)[None], True
    return finite_array(name, value, (None, *shape)), False


def whole_number(name: str, value: object, at_least: int, at_most: float = math.inf) -> int:
    """Return a whole number in a range, or refuse it.

    Parameters
    ----------
    name, value
        Name of the argument for messages, and its value.
    at_least, at_most : int
        Its range.
    """
    if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < at_least:
        raise InvalidInputError(
            f"{name} must be a whole number of at least {at_least}, got {value!r}"
        )
    if value > at_most:
        raise InvalidInputError(f"{name} must be at most {at_most}, got {value}")
    return int(value)


def check_range(name: str, value: Any, demands: Mapping[str, Any]) -> None:
    """Refuse numbers that are not finite or break demands of their field.

    Parameters
    ----------
    name : str
        Name of the field, for messages.
    value : object
        Its value, or a tuple of such; anything but numbers passes.
    demands : mapping
        Metadata of the field. For whole numbers: ``at_least``, 1 by default,
        and ``at_most``. For others: a condition that ``holds``, and what they
        ``must`` in words.
    """
    if isinstance(value, tuple):
        for each in value:
            check_range(name, each, demands)
    elif type(value) is int:
        whole_number(name, value, demands.get("at_least", 1), demands.get("at_most", math.inf))
    elif isinstance(value, float):
        must, holds = demands.get("must", "be finite"), demands.get("holds", math.isfinite)
        if not (math.isfinite(value) and holds(value)):
            raise InvalidInputError(f"{name} must {must}, got {value}")
        if abs(value) > LARGEST:
            raise InvalidInputError(f"{name} must be at most {LARGEST:g}, got {value}")
