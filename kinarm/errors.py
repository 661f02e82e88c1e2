"""Every error that kinarm raises on purpose.

::

    KinarmError
    ├── ArmError, ProblemError
    ├── PolicyFileError, RecordingFileError, OutputError
    ├── InvalidInputError, which is a ValueError
    │   └── UnknownNameError
    ├── StartInContactError, MissingExtraError
    └── WorkerError, TrainingFailedError

Command lines turn any of them into one line on standard error and exit status 2, or 1 for the last
two, which are failures of a run.
"""

import copyreg
from collections.abc import Iterable, Mapping
from typing import Any

LONGEST = 1500
"""Characters of a message; of a longer one, the middle is left out."""


def one_line(text: str) -> str:
    """A message as one line, without the middle of one that is very long."""
    line = " ".join(text.split())
    if len(line) <= LONGEST:
        return line
    return f"{line[: LONGEST // 2]} ... {line[-LONGEST // 2 :]}"


class KinarmError(Exception):
    """Base of all errors that kinarm raises on purpose; what they say is one line."""

    exit_status = 2
    """Exit status of a command."""

    def __str__(self) -> str:
        return one_line(super().__str__())

    def __reduce__(self) -> tuple[Any, ...]:
        # Made anew from its message and its attributes, whatever its constructor takes.
        return copyreg.__newobj__, (type(self), *self.args), vars(self)  # type: ignore[attr-defined]


class ArmError(KinarmError):
    """A robot description is missing, malformed or describes what kinarm cannot simulate."""


class ProblemError(KinarmError):
    """A problem is inconsistent, offers no contact-free start, or is not the one expected."""


class InvalidInputError(KinarmError, ValueError):
    """An argument has the wrong shape or range, or is not finite."""


class UnknownNameError(InvalidInputError):
    """A name that does not exist.

    Parameters
    ----------
    kind, given : str
        What was looked up, such as ``"task"``, and the name as given.
    available : iterable of str
        The names that exist.
    """

    def __init__(self, kind: str, given: str, available: Iterable[str]) -> None:
        self.kind, self.given, self.available = kind, given, tuple(available)
        super().__init__(f"unknown {kind} {given!r}; available: {', '.join(self.available)}")


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
        self.index, self.pair = index, pair
        super().__init__(f"start {index} is in contact: {pair[0]} touches {pair[1]}")


class PolicyFileError(KinarmError):
    """A policy file is missing, truncated, foreign, too new, or made for something else."""


class RecordingFileError(KinarmError):
    """A file of recordings is missing, truncated, foreign or too new."""


class OutputError(KinarmError):
    """A file or folder cannot be written."""


class WorkerError(KinarmError):
    """A worker process ended unexpectedly."""

    exit_status = 1


class TrainingFailedError(KinarmError):
    """Trainings of an experiment failed; all others are finished.

    Parameters
    ----------
    reasons : mapping of str to str
        Why they failed, in a line, by their names.
    trainings : int
        Trainings of the experiment.
    """

    exit_status = 1

    def __init__(self, reasons: Mapping[str, str], trainings: int) -> None:
        self.reasons, self.trainings = dict(reasons), trainings
        told = "; ".join(f"{name}: {reason}" for name, reason in reasons.items())
        super().__init__(f"{len(reasons)} of {trainings} trainings failed: {told}")


class MissingExtraError(KinarmError):
    """An optional package that is not installed.

    Parameters
    ----------
    package, extra : str
        What is missing, and the extra of kinarm that brings it.
    """

    def __init__(self, package: str, extra: str) -> None:
        self.package, self.extra = package, extra
        super().__init__(f"{package} is not installed: pip install 'kinarm[{extra}]'")
