"""The tree of errors."""

import pickle

import pytest

from kinarm import errors

EXAMPLES = [
    errors.ArmError("no arm"),
    errors.ProblemError("no problem"),
    errors.InvalidInputError("no input"),
    errors.UnknownNameError("task", "up", ("left", "right")),
    errors.StartInContactError(3, ("hand", "ground")),
    errors.PolicyFileError("no file"),
    errors.RecordingFileError("no recording"),
    errors.OutputError("no space"),
    errors.MissingExtraError("torch", "sb3"),
    errors.WorkerError("a worker ended"),
    errors.TrainingFailedError({"ars right seed 0": "too fast"}, 4),
    errors.NoPathError(100),
    errors.RunStoppedError("lost the arm"),
]


def test_one_handler_catches_them_all():
    raised = [value for value in vars(errors).values() if isinstance(value, type)]
    exceptions = [value for value in raised if issubclass(value, Exception)]
    assert len(exceptions) == len(EXAMPLES) + 1
    assert all(issubclass(value, errors.KinarmError) for value in exceptions)
    assert issubclass(errors.UnknownNameError, ValueError)


@pytest.mark.parametrize("error", EXAMPLES, ids=lambda error: type(error).__name__)
def test_pickle_keeps_everything(error):
    copy = pickle.loads(pickle.dumps(error))
    assert type(copy) is type(error)
    assert str(copy) == str(error)
    assert vars(copy) == vars(error)
