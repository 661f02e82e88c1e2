"""The tree of errors."""

import pickle

import pytest

from kinarm import errors
from kinarm.errors import (
    ArmError,
    InvalidInputError,
    KinarmError,
    MissingExtraError,
    OutputError,
    PolicyFileError,
    ProblemError,
    RecordingFileError,
    StartInContactError,
    TrainingFailedError,
    UnknownNameError,
    WorkerError,
)

EXAMPLES = [
    ArmError("no arm"),
    ProblemError("no problem"),
    InvalidInputError("no input"),
    UnknownNameError("task", "up", ("left", "right")),
    StartInContactError(3, ("hand", "ground")),
    PolicyFileError("no file"),
    RecordingFileError("no recording"),
    OutputError("no space"),
    MissingExtraError("torch", "ppo"),
    WorkerError("a worker ended"),
    TrainingFailedError({"ars right seed 0": "too fast"}, 4),
]


def test_one_handler_catches_them_all():
    raised = [value for value in vars(errors).values() if isinstance(value, type)]
    exceptions = [value for value in raised if issubclass(value, Exception)]
    assert len(exceptions) == len(EXAMPLES) + 1
    assert all(issubclass(value, KinarmError) for value in exceptions)


@pytest.mark.parametrize("error", EXAMPLES, ids=lambda error: type(error).__name__)
def test_pickle_keeps_everything(error):
    copy = pickle.loads(pickle.dumps(error))
    assert type(copy) is type(error)
    assert str(copy) == str(error)
    assert vars(copy) == vars(error)


def test_unknown_name_says_what_exists():
    error = UnknownNameError("task", "up", iter(["left", "right"]))
    assert str(error) == "unknown task 'up'; available: left, right"
    assert (error.kind, error.given, error.available) == ("task", "up", ("left", "right"))


def test_bad_input_is_a_value_error():
    assert issubclass(InvalidInputError, ValueError)
    assert issubclass(UnknownNameError, InvalidInputError)
