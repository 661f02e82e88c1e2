"""What a board says of trainings in other processes: what they prepare, then how they do."""

import pytest

from kinarm._console import COMPILING, doing, told_of_activities
from kinarm.policies.learners import CurvePoint, TrainingState
from kinarm.policies.progress_board import BoardWatcher, ProgressBoard
from kinarm.policies.training import STARTING

FIRST = "learning from others first"


@pytest.fixture
def board(tmp_path):
    """A board of two trainings that wait."""
    board = ProgressBoard(tmp_path, 2)
    board.clear()
    return board


def test_what_takes_long_before_the_first_iteration_is_said(board):
    assert board.words() == [STARTING]
    watcher = BoardWatcher(board, 1)
    watcher.prepare("")
    with told_of_activities(watcher.prepare):
        assert board.words() == [STARTING]
        with doing(FIRST):
            with doing(COMPILING):
                assert board.words() == [COMPILING]
            assert board.words() == [FIRST]
        assert board.words() == [STARTING]


def test_then_the_range_of_success_is(board):
    watchers = [BoardWatcher(board, number) for number in range(2)]
    for watcher, success in zip(watchers, (0.25, 0.5), strict=True):
        watcher.prepare(FIRST)
        watcher.update(TrainingState(curve=(CurvePoint(0.0, 0.0, success, 10, 1.0),)))
    assert board.words() == ["success 25-50 %"]
    assert board.iterations == 2
