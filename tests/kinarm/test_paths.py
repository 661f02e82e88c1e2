"""Own paths: what a recording of one holds is what the simulator would have done."""

from itertools import pairwise

import numpy as np
import pytest

from kinarm import load_recordings, record_path, save_recordings
from kinarm.errors import InvalidInputError, StartInContactError
from kinarm.viewer import replay_page

BELOW = np.deg2rad([0, 110, -60, 0, 0, 0])
"""The arm reaches into the ground."""


def straight_actions(simulator, start, end):
    """Actions that move straight from one configuration to another, then rest."""
    shares = (end - start)[: simulator.n_actions] / simulator.step_limit
    steps = int(np.ceil(np.abs(shares).max() - 1e-9))
    actions = np.zeros((1, simulator.task.horizon, simulator.n_actions))
    actions[0, :steps] = shares / steps
    return actions


def test_moves_at_full_speed_along_straight_lines(simulator):
    path = np.array([[0, 0, 0, 0, 0, 0], [0.5, 0.1, 0, 0, 0, 1.0], [0.5, -0.3, 0.4, 0, 0.1, 1.0]])
    recording = record_path(simulator.world, path)
    moves = np.abs(np.diff(recording.states, axis=0))
    limit = simulator.arm.velocity_limits * simulator.problem.stepping.time_step
    assert (moves <= limit * (1 + 1e-9)).all()
    steps = [int(np.ceil((abs(b - a) / limit).max())) for a, b in pairwise(path)]
    assert recording.steps == sum(steps)
    np.testing.assert_array_equal(recording.states[[0, steps[0], -1]], path)
    np.testing.assert_allclose(moves[: steps[0]].max(axis=0), np.abs(path[1]) / steps[0])
    np.testing.assert_allclose(recording.goal, simulator.arm.tool_position(path[-1]), atol=1e-12)
    assert recording.outcome == "success"
    assert recording.contact is None
    assert recording.policy == "path"


def test_is_what_the_simulator_does(simulator):
    """Same steps, distances and contact as the same motion in the simulator."""
    rng, outcomes = np.random.default_rng(1), []
    starts, goals = simulator.sample(rng, 40)
    ends, _ = simulator.sample(rng, 40)
    for start, end, goal in zip(starts, ends, goals, strict=True):
        recording = record_path(simulator.world, [start, end], goal=goal)
        actions = straight_actions(simulator, start, end)
        rollout = simulator.rollout_actions(actions, [start], [goal], record=True)
        if rollout.success[0] and rollout.steps[0] < recording.steps:
            continue  # it came past the goal
        assert bool(rollout.collision[0]) == (recording.outcome == "collision")
        if rollout.collision[0]:
            assert rollout.steps[0] == recording.steps
            assert simulator.contact_pairs(rollout)[0] == recording.contact
            path = rollout.paths[0, : recording.steps + 1]
            np.testing.assert_allclose(path, recording.states, rtol=0, atol=1e-12)
            assert simulator.world.contact_pair(recording.refused) == recording.contact
        outcomes.append(recording.outcome)
    assert {"collision", "truncated"} <= set(outcomes)


def test_ends_where_it_touches(simulator):
    recording = record_path(simulator.problem, [np.zeros(6), BELOW, np.zeros(6)], name="mine")
    assert recording.outcome == "collision"
    assert recording.policy == "mine"
    assert "ground" in recording.contact
    assert recording.contact_point[2] == pytest.approx(0, abs=0.05)
    np.testing.assert_array_equal(recording.states[-1], recording.states[-2])
    assert not simulator.world.in_contact(recording.states).any()
    assert simulator.world.in_contact(recording.refused)


def test_replay_in_one_call(simulator, tmp_path):
    path = [np.zeros(6), BELOW]
    page = replay_page(record_path(simulator.problem, path), tmp_path / "path.html")
    assert (tmp_path / "path.html").read_text(encoding="utf-8") == page.html
    recording = record_path(simulator.world, path)
    assert replay_page(recording).html == page.html
    save_recordings(tmp_path / "path.npz", [recording])
    assert load_recordings(tmp_path / "path.npz")[0].contact == recording.contact


@pytest.mark.parametrize(
    ("path", "message"),
    [
        (np.zeros(6), r"path must have shape \(n, 6\)"),
        (
            [np.zeros(6), [0, 0, 4, 0, 0, 0]],
            r"path\[1\] lies outside the limits: axis_3 at 4, -1\.25664 to 3\.22",
        ),
    ],
)
def test_bad_paths(simulator, tmp_path, path, message):
    with pytest.raises(InvalidInputError, match=message):
        record_path(simulator.world, path)


def test_a_start_in_contact(simulator):
    with pytest.raises(StartInContactError, match="start 0 is in contact: "):
        record_path(simulator.world, [BELOW, np.zeros(6)])
