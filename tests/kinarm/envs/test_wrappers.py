"""Gymnasium's vector wrappers around the native batch, held against those around a loop."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import vector

NUMBER = 3
WRAPPERS = ("DictInfoToList", "NormalizeObservation", "RecordEpisodeStatistics")
"""Those that read more than one array, or keep something from step to step."""


def pair(name, autoreset_mode):
    """A wrapper around the batch, and around a loop of single environments."""
    wrapper = getattr(vector, name)
    batch = gymnasium.make_vec(
        "kinarm/ReachBoth-v0", num_envs=NUMBER, horizon=20, autoreset_mode=autoreset_mode
    )
    loop = gymnasium.make_vec(
        "kinarm/ReachBoth-v0",
        num_envs=NUMBER,
        horizon=20,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": autoreset_mode},
    )
    return [wrapper(env) for env in (batch, loop)]


@pytest.mark.parametrize("name", WRAPPERS)
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_wrapped_batch_equals_wrapped_loop(name, mode):
    if mode is AutoresetMode.SAME_STEP and name == "NormalizeObservation":
        pytest.skip("Gymnasium has it for NextStep only")
    batch, loop = pair(name, mode)
    assert batch.single_observation_space == loop.single_observation_space
    assert batch.single_action_space == loop.single_action_space
    first, second = batch.reset(seed=4), loop.reset(seed=4)
    rng = np.random.default_rng(0)
    for _ in range(60):
        assert data_equivalence(first[0], second[0], exact=True)
        if name == "DictInfoToList":
            assert len(first[-1]) == NUMBER
        if len(first) == 5:
            np.testing.assert_array_equal(first[1], second[1])
            np.testing.assert_array_equal(first[2] | first[3], second[2] | second[3])
            if "episode" in second[-1]:
                for key in ("r", "l"):
                    np.testing.assert_array_equal(
                        first[-1]["episode"][key], second[-1]["episode"][key]
                    )
        actions = rng.uniform(-1, 1, (NUMBER, 5)).astype(np.float32)
        first, second = batch.step(actions), loop.step(actions)
    batch.close(), loop.close()


def test_dictionaries_of_goals_can_be_flattened_and_filtered():
    env = gymnasium.make_vec("kinarm/ReachGoalRight-v0", num_envs=NUMBER)
    assert vector.FlattenObservation(env).reset(seed=0)[0].shape == (NUMBER, 48)
    env = vector.FlattenObservation(
        vector.FilterObservation(env, ["desired_goal", "achieved_goal"])
    )
    assert env.reset(seed=0)[0].shape == (NUMBER, 6)
    assert env.step(env.action_space.sample())[0].shape == (NUMBER, 6)
