"""Checkpoint files; that they resume exactly is tested with the training."""

import gc
import json
from dataclasses import replace

import numpy as np
import pytest

from kinarm.errors import PolicyFileError
from kinarm.policies import ARSConfig, train_policy
from kinarm.policies.checkpoint import load_checkpoint, save_checkpoint
from kinarm.problem import PROBLEMS

TINY = ARSConfig(
    directions=2, top_directions=1, iterations=3, problem=PROBLEMS["left"].replace(horizon=4)
)


@pytest.fixture(scope="module")
def state():
    states = []
    train_policy(TINY, on_iteration=states.append)
    return states[1]


@pytest.fixture
def saved(state, tmp_path):
    path = tmp_path / "run.ckpt"
    save_checkpoint(path, TINY, state)
    return path


def contents(path):
    with np.load(path) as file:
        return dict(file)


def refused(path):
    with pytest.raises(PolicyFileError) as caught:
        load_checkpoint(path)
    gc.collect(1)  # a file left open is reported here, not in a later test
    assert path.name in str(caught.value)
    assert "\n" not in str(caught.value)


def test_round_trip(saved, state):
    config, loaded = load_checkpoint(saved)
    assert config == TINY
    assert loaded.theta.tobytes() == state.theta.tobytes()
    assert loaded.normalizer.count == state.normalizer.count
    assert loaded.normalizer.mean.tobytes() == state.normalizer.mean.tobytes()
    assert loaded.normalizer.squares.tobytes() == state.normalizer.squares.tobytes()
    assert loaded.generator == state.generator
    assert loaded.curve == state.curve
    assert [type(value) for value in loaded.curve[0]] == [type(value) for value in state.curve[0]]


def test_before_the_first_iteration(state, tmp_path):
    save_checkpoint(tmp_path / "new.ckpt", TINY, replace(state, curve=()))
    assert load_checkpoint(tmp_path / "new.ckpt")[1].iteration == 0


def spoil(path, **entries):
    spoilt = {**contents(path), **entries}
    with path.open("wb") as file:
        np.savez(file, **spoilt)


def test_impossible_setting_is_named(saved):
    header = json.loads(str(contents(saved)["header"]))
    header["config"]["directions"] = 0
    spoil(saved, header=json.dumps(header))
    with pytest.raises(PolicyFileError, match="directions"):
        load_checkpoint(saved)


@pytest.mark.parametrize(
    "entries",
    [
        {"state.theta": np.zeros((5, 48), dtype=np.float32)},
        {"state.theta": np.full((5, 48), np.nan)},
    ],
    ids=["type", "nan"],
)
def test_arrays_of_another_type_or_not_finite_are_refused_before_training(saved, entries):
    spoil(saved, **entries)
    refused(saved)


def test_an_arm_that_changed_since_is_refused(tmp_path, write_robot, make_joint):
    path = write_robot([make_joint(), make_joint(axis="0 1 0")])
    config = replace(TINY, problem=TINY.problem.replace(arm=str(path)))
    states = []
    train_policy(replace(config, iterations=1), on_iteration=states.append)
    save_checkpoint(tmp_path / "c.npz", config, states[0])
    assert load_checkpoint(tmp_path / "c.npz")[0] == config
    slower = path.read_text().replace('velocity="3"', 'velocity="2"')
    path.write_text(slower)
    with pytest.raises(PolicyFileError, match="has changed since"):
        load_checkpoint(tmp_path / "c.npz")
