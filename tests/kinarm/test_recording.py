"""Recordings: they say what the simulator did, and survive a file."""

from dataclasses import fields, replace

import numpy as np
import pytest

from kinarm.errors import InvalidInputError
from kinarm.recording import ARRAYS, Recording, load_recordings, record_rollouts, save_recordings
from kinarm.scene import Obstacle, Scene

EPISODES = 40


@pytest.fixture(scope="module")
def rollouts(simulator):
    """Random motions: some of them collide."""
    rng = np.random.default_rng(3)
    starts, goals = simulator.sample(rng, EPISODES)
    actions = rng.uniform(-1, 1, (EPISODES, simulator.task.horizon, simulator.n_actions))
    return simulator.rollout_actions(actions, starts, goals, record=True)


@pytest.fixture(scope="module")
def recordings(simulator, rollouts):
    return record_rollouts(
        simulator,
        rollouts,
        "random",
        steps_lower_bound=lambda number: number + 1,
        provenance={"seed": 3},
    )


def elsewhere(recording: Recording, **changes: object) -> Recording:
    """A recording as if another problem had been faced."""
    return replace(recording, problem=recording.problem.replace(**changes))


def same(first: Recording, second: Recording) -> bool:
    """Equal to the last bit."""
    for item in fields(Recording):
        a, b = getattr(first, item.name), getattr(second, item.name)
        if item.name in ARRAYS and a is not None:
            if b is None or a.shape != b.shape or a.tobytes() != b.tobytes():
                return False
        elif a != b:
            return False
    return True


def test_ends_are_those_of_the_rollouts(simulator, rollouts, recordings):
    outcomes = {recording.outcome for recording in recordings}
    assert outcomes == {"collision", "truncated"}
    assert [each.steps for each in recordings] == rollouts.steps.tolist()
    assert [each.final_distance for each in recordings] == rollouts.distance.tolist()
    assert [each.contact for each in recordings] == list(simulator.contact_pairs(rollouts))
    for number, each in enumerate(recordings):
        assert each.trial == number
        assert each.steps_lower_bound == number + 1
        assert (each.states[0] == rollouts.starts[number]).all()
        assert (each.states[-1] == rollouts.configurations[number]).all()


def test_distances_are_those_of_the_tool(simulator, recordings):
    for each in recordings[:5]:
        tools = np.array([simulator.arm.tool_position(state) for state in each.states])
        expected = np.linalg.norm(tools - each.goal, axis=1)
        np.testing.assert_allclose(each.distances, expected, rtol=0, atol=1e-12)


def test_contact_lies_on_both_bodies(simulator, recordings):
    """The refused configuration touches, and the point lies in the bench that is named."""
    collided = [each for each in recordings if each.contact]
    assert collided
    benches = {obstacle.name: obstacle for obstacle in simulator.scene.obstacles}
    for each in collided:
        assert simulator.world.contact_model.in_contact(each.refused[None])[0]
        assert not simulator.world.contact_model.in_contact(each.states[-1][None])[0]
        assert (each.states[-1] == each.states[-2]).all()
        if bench := benches.get(each.contact[1]):
            assert (each.contact_point > np.array(bench.lower) - 0.15).all()
            assert (each.contact_point < np.array(bench.upper) + 0.15).all()


def test_what_cannot_be_recorded(simulator, rollouts):
    with pytest.raises(InvalidInputError, match="no trial 40: there are 0 to 39"):
        record_rollouts(simulator, rollouts, "random", [EPISODES])
    actions = np.zeros((1, simulator.task.horizon, simulator.n_actions))
    bare = simulator.rollout_actions(actions, rollouts.starts[:1], rollouts.goals[:1])
    with pytest.raises(InvalidInputError, match="record=True"):
        record_rollouts(simulator, bare, "zero")


def test_they_survive_a_file(recordings, tmp_path):
    desk = Obstacle(name="desk", lower=(0, -1, 0), upper=(1, 1, 0.4))
    scene = Scene(obstacles=(desk,), ground=False)
    recording = elsewhere(recordings[0], scene=scene, tolerance=0.03, time_step=0.01)
    recording = replace(recording, trial=np.int64(recording.trial))
    save_recordings(tmp_path / "made.npz", [recording, *recordings])
    loaded = load_recordings(tmp_path / "made.npz")
    assert all(same(a, b) for a, b in zip([recording, *recordings], loaded, strict=True))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"outcome": "lost"}, "outcome must be one of"),
        ({"states": np.zeros((0, 6))}, "states"),
        ({"goal": [0, np.nan, 0]}, "finite"),
    ],
)
def test_nonsense_is_refused(recordings, change, words):
    with pytest.raises(InvalidInputError, match=words):
        replace(recordings[0], **change)
