"""Recordings: they say what the simulator did, and survive a file."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest

from kinarm.errors import InvalidInputError, RecordingFileError
from kinarm.recording import (
    ARRAYS,
    Recording,
    load_recordings,
    record_rollouts,
    save_recordings,
)
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


def test_success_is_recorded(simulator):
    """The goal lies where the tool is after ten steps."""
    start = np.deg2rad([20.0, 10, 10, 0, -60, 0])[None]
    waving = np.tile([1.0, 0, 0, 0, 0], (1, simulator.task.horizon, 1))
    end = start[0] + 10 * simulator.step_limit[0] * np.eye(6)[0]
    goal = simulator.arm.tool_position(end)[None]
    rollouts = simulator.rollout_actions(waving, start, goal, record=True)
    (recording,) = record_rollouts(simulator, rollouts, "wave")
    assert recording.outcome == "success"
    assert recording.steps == 10
    assert recording.final_distance <= simulator.task.tolerance < recording.distances[-2]


def test_some_numbers_only(simulator, rollouts, recordings):
    chosen = record_rollouts(simulator, rollouts, "random", [7, 2])
    assert [each.trial for each in chosen] == [7, 2]
    assert (chosen[0].states == recordings[7].states).all()


@pytest.mark.parametrize("number", [-1, EPISODES])
def test_a_number_out_of_range(simulator, rollouts, number):
    with pytest.raises(InvalidInputError, match=f"no trial {number}: there are 0 to 39"):
        record_rollouts(simulator, rollouts, "random", [number])


def test_rollouts_without_configurations(simulator, rollouts):
    actions = np.zeros((1, simulator.task.horizon, simulator.n_actions))
    bare = simulator.rollout_actions(actions, rollouts.starts[:1], rollouts.goals[:1])
    with pytest.raises(InvalidInputError, match="record=True"):
        record_rollouts(simulator, bare, "zero")


def test_several_survive_a_file(recordings, tmp_path):
    path = tmp_path / "made.npz"
    save_recordings(path, recordings)
    loaded = load_recordings(path)
    assert len(loaded) == EPISODES
    assert all(same(a, b) for a, b in zip(recordings, loaded, strict=True))


def test_one_survives_a_file(recordings, tmp_path):
    desk = Obstacle(name="desk", lower=(0, -1, 0), upper=(1, 1, 0.4))
    scene = Scene(obstacles=(desk,), ground=False)
    recording = elsewhere(recordings[0], scene=scene, tolerance=0.03, time_step=0.01)
    recording.save(tmp_path / "made.npz")
    assert same(recording, Recording.load(tmp_path / "made.npz"))


def test_one_is_not_several(recordings, tmp_path):
    save_recordings(tmp_path / "made.npz", recordings[:2])
    with pytest.raises(RecordingFileError, match="holds 2 recordings"):
        Recording.load(tmp_path / "made.npz")


def test_arrays_are_copied_and_read_only(recordings):
    states = np.array(recordings[0].states)
    recording = replace(recordings[0], states=states)
    states[:] = 0
    assert (recording.states == recordings[0].states).all()
    with pytest.raises(ValueError, match="read-only"):
        recording.states[0] = 0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"outcome": "lost"}, "outcome must be one of"),
        ({"trial": -1}, "trial"),
        ({"states": np.zeros((0, 6))}, "states"),
        ({"distances": np.zeros(2)}, "distances"),
        ({"goal": [0, np.nan, 0]}, "finite"),
        ({"refused": np.zeros(5)}, "refused"),
    ],
)
def test_nonsense_is_refused(recordings, change, words):
    with pytest.raises(InvalidInputError, match=words):
        replace(recordings[0], **change)


def test_missing_entries(recordings, tmp_path):
    path = tmp_path / "made.npz"
    recordings[0].save(path)
    content = dict(np.load(path))
    header = json.loads(str(content["header"]))
    del header["recordings"][0]["policy"]
    np.savez(path, **{**content, "header": np.array(json.dumps(header))})
    with pytest.raises(RecordingFileError, match="policy"):
        load_recordings(path)
    del header["problems"][0]["task"]
    np.savez(path, **{**content, "header": np.array(json.dumps(header))})
    with pytest.raises(RecordingFileError, match="task"):
        load_recordings(path)
    np.savez(path, **{**content, "header": np.array("[1]")})
    with pytest.raises(RecordingFileError, match="not a complete kinarm recording"):
        load_recordings(path)
    del content["states_0"]
    np.savez(path, **content)
    with pytest.raises(RecordingFileError, match="states"):
        load_recordings(path)
