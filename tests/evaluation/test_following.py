"""Fresh trials that are followed on a live page, and the page that is asked for."""

import itertools
import socket

import numpy as np
import pytest

from kinarm.evaluation import ReplayRequest
from kinarm.evaluation.contestants import ORACLE
from kinarm.evaluation.finding import find_contestants
from kinarm.evaluation.replay import runs
from kinarm.evaluation.replay.runs import follow, fresh_recordings
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.oracle import Oracle
from kinarm.simulator import Simulator
from kinarm.viewer.live_server import LiveServer


@pytest.fixture
def no_waiting(monkeypatch):
    waited = []
    monkeypatch.setattr(runs.time, "sleep", waited.append)
    return waited


@pytest.fixture
def port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture(scope="module")
def left():
    return Simulator("left", threads=1)


def test_every_trial_is_that_of_the_next_seed(left):
    (contestant,) = find_contestants("zero")
    found = list(itertools.islice(fresh_recordings(contestant, left, 5), 3))
    assert [recording.trial for recording in found] == [0, 1, 2]
    for seed, recording in enumerate(found, start=5):
        trials = TrialSet.draw("left", 1, seed)
        np.testing.assert_array_equal(recording.states[0], trials.starts[0])
        np.testing.assert_array_equal(recording.goal, trials.goals[0])
        assert recording.outcome == "truncated"


def test_the_oracle_reaches_goals_in_the_steps_that_it_finds(left):
    (recording,) = itertools.islice(fresh_recordings(ORACLE, left, 2), 1)
    trials = TrialSet.draw("left", 1, 2)
    solution = Oracle("left").solve(trials.starts[0], trials.goals[0])
    assert recording.outcome == "success"
    assert recording.steps == solution.steps
    np.testing.assert_array_equal(recording.states, solution.path)


def test_following_takes_its_time_and_hands_out_what_is_over(left, no_waiting, port):
    (contestant,) = find_contestants("zero")
    recordings = list(itertools.islice(fresh_recordings(contestant, left, 0), 2))
    with LiveServer(port) as server:
        seen = []
        for recording in follow(server, left, recordings):
            seen.append(recording)
            assert len(no_waiting) == len(seen) * 65 + len(seen) - 1
    assert seen == recordings
    slowed = runs.SLOWDOWN * left.problem.stepping.time_step
    assert set(no_waiting) == {slowed, runs.REST}


class EnoughError(Exception):
    """Nobody wants to see more."""


def stop_after(lines, count):
    def report(line):
        lines.append(line)
        if len(lines) == count:
            raise EnoughError

    return report


def test_live_request_says_where_it_goes_instead(no_waiting, port):
    lines = []
    request = ReplayRequest(policy="zero", problem="left", live=True, port=port, browser=False)
    with LiveServer(port), pytest.raises(EnoughError):
        request.run(stop_after(lines, 2))
    assert lines[0].startswith(f"port {port} is in use: taking ")
    assert lines[1].startswith("zero at http://127.0.0.1:")
    assert f":{port}/" not in lines[1]
