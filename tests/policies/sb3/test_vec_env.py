"""The environment for Stable-Baselines3 held against their own way of stepping many arms."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence

pytest.importorskip("stable_baselines3")

from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

from kinarm.errors import InvalidInputError
from kinarm.policies import sb3_vec_env

NUMBER = 6
FLAT, GOALS = "kinarm/ReachRight-v0", "kinarm/ReachGoalRight-v0"
SETTINGS = {"tolerance": 0.5, "observation_dtype": "float32"}
SIZE = {"width": 64, "height": 48}
FINAL_KEYS = {
    "terminal_observation": ...,
    "TimeLimit.truncated": bool,
    "is_success": bool,
    "collision": bool,
    "distance": float,
    "configuration": np.ndarray,
    "episode": dict,
}


def dummy_vec_env(env_id, **settings):
    """Single environments, stepped one after the other by Stable-Baselines3."""
    return DummyVecEnv([lambda: Monitor(gymnasium.make(env_id, **settings))] * NUMBER)


def assert_same(first, second):
    if isinstance(first, dict):
        assert first.keys() == second.keys()
        for key in first:
            assert_same(first[key], second[key])
    else:
        assert first.dtype == second.dtype
        np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("horizon", [64, 3])
@pytest.mark.parametrize("env_id", [FLAT, GOALS])
def test_equals_single_environments_of_theirs(env_id, horizon):
    ours = sb3_vec_env(env_id, NUMBER, horizon=horizon, **SETTINGS)
    theirs = dummy_vec_env(env_id, horizon=horizon, **SETTINGS)
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    for env in (ours, theirs):
        env.seed(11)
    assert_same(ours.reset(), theirs.reset())
    rng = np.random.default_rng(0)
    ends = {"is_success": 0, "collision": 0, "TimeLimit.truncated": 0}
    for _ in range(150):
        assert data_equivalence(ours.reset_infos, theirs.reset_infos, exact=True)
        configurations = (env.get_attr("configuration") for env in (ours, theirs))
        np.testing.assert_array_equal(*map(np.array, configurations))
        actions = rng.uniform(-1, 1, (NUMBER, 5)).astype(np.float32)
        observations, rewards, dones, infos = ours.step(actions)
        expected = theirs.step(actions)
        for found, wanted in zip((observations, rewards, dones), expected[:3], strict=True):
            assert_same(found, wanted)
        for done, info, wanted in zip(dones, infos, expected[3], strict=True):
            if not done:
                assert info == ({"collision": True} if wanted["collision"] else {})
            else:
                assert set(info) == set(FINAL_KEYS)
                final = info.pop("terminal_observation"), wanted.pop("terminal_observation")
                assert_same(*final)
                episode, monitored = info.pop("episode"), wanted.pop("episode")
                assert episode["l"] == monitored["l"]
                assert episode["r"] == pytest.approx(monitored["r"], abs=1e-6)  # which is rounded
                assert episode["t"] > 0
                assert data_equivalence(info, {key: wanted[key] for key in info}, exact=True)
                for key in ends:
                    ends[key] += info[key]
    assert ends["is_success"] > 0
    assert ends["TimeLimit.truncated"] > 2 or (env_id == FLAT and horizon == 64)
    assert ends["collision"] > 0


class TestSeeds:
    def test_same_seed_same_run(self):
        def run(env):
            env.seed(4)
            rng = np.random.default_rng(1)
            return [env.reset(), *(env.step(rng.uniform(-1, 1, (3, 5)))[0] for _ in range(80))]

        env = sb3_vec_env("both", 3)
        first = run(env)
        for other in (env, sb3_vec_env("both", 3)):
            assert_same(np.array(first), np.array(run(other)))


def test_starts_and_goals_can_be_set_once():
    env = sb3_vec_env(GOALS, 3, seed=0)
    goal = np.array([0.1, -0.7, 0.5])
    env.set_options([{"goal": goal}, {}, {"goal": -goal}])
    goals = env.reset()["desired_goal"]
    np.testing.assert_allclose(goals[[0, 2]], [goal, -goal], rtol=1e-6)
    assert not np.isin(env.reset()["desired_goal"], [goal, -goal]).any()


class TestAttributes:
    def test_arms_share_everything(self):
        env = sb3_vec_env(GOALS, NUMBER)
        assert env.get_attr("render_mode") == [None] * NUMBER
        assert env.get_attr("simulator", indices=[0, 3]) == [env.simulator] * 2
        assert env.get_attr("spec")[0].id == GOALS
        assert env.get_attr("metadata")[0]["render_fps"] == 50

    def test_set_attr_is_for_all_arms(self):
        env = sb3_vec_env(FLAT, 3)
        env.set_attr("note", "mine")
        assert env.get_attr("note") == ["mine"] * 3
        env.set_attr("note", "yours", indices=[2, 0, 1])
        with pytest.raises(InvalidInputError, match="cannot set 'note' for some arms"):
            env.set_attr("note", "others", indices=[1])
        assert env.get_attr("note") == ["yours"] * 3

    def test_infos_are_as_if_monitored(self):
        env = sb3_vec_env(FLAT, 2)
        assert env.env_is_wrapped(Monitor) == [True, True]
        assert env.env_is_wrapped(gymnasium.wrappers.TimeLimit, indices=0) == [False]


class TestPictures:
    def test_a_picture_shows_all_arms(self):
        pytest.importorskip("raylib")
        env = sb3_vec_env(FLAT, 3, seed=0, render_mode="rgb_array", **SIZE)
        env.reset()
        picture, images = env.render(), env.get_images()
        assert (picture.shape, picture.dtype) == ((96, 128, 3), np.uint8)
        np.testing.assert_array_equal(picture[:48, 64:], images[1])
        assert len(np.unique(np.array(images), axis=0)) == 3
