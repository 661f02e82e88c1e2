"""The environment for Stable-Baselines3 held against their own way of stepping many arms."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence

pytest.importorskip("stable_baselines3")

from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecFrameStack

from kinarm.envs import ReachVectorEnv
from kinarm.errors import InvalidInputError, StartInContactError
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


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("env_id", [FLAT, GOALS])
def test_results_are_of_the_spaces(env_id, dtype):
    env = sb3_vec_env(env_id, NUMBER, observation_dtype=dtype)
    for observations in (env.reset(), env.step(np.ones((NUMBER, 5)))[0]):
        parts = observations if isinstance(observations, dict) else {"": observations}
        assert {part.dtype for part in parts.values()} == {np.dtype(dtype)}
        for row in range(NUMBER):
            one = {key: part[row] for key, part in parts.items()}
            assert env.observation_space.contains(one if env_id == GOALS else one[""])


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


class TestOptions:
    def test_starts_and_goals_can_be_set_once(self):
        env = sb3_vec_env(GOALS, 3, seed=0)
        goal = np.array([0.1, -0.7, 0.5])
        env.set_options([{"goal": goal}, {}, {"goal": -goal}])
        goals = env.reset()["desired_goal"]
        np.testing.assert_allclose(goals[[0, 2]], [goal, -goal], rtol=1e-6)
        assert not np.isin(env.reset()["desired_goal"], [goal, -goal]).any()

    def test_bad_options(self):
        env = sb3_vec_env(FLAT, 2)
        with pytest.raises(InvalidInputError, match="unknown reset option 'speed'"):
            env.set_options({"speed": 1})
        env.set_options([{"speed": 1}, {}])
        with pytest.raises(InvalidInputError, match="unknown reset option 'speed'"):
            env.reset()

    def test_a_start_and_goal_of_each(self):
        env = sb3_vec_env(FLAT, 3, seed=0, observation_dtype="float64")
        batch = ReachVectorEnv(3, "right")
        starts, goals = env.simulator.sample(np.random.default_rng(0), 3)
        for options in ({"start": starts, "goal": goals}, {"start": starts[0], "goal": goals[0]}):
            env.set_options(options)
            np.testing.assert_array_equal(env.reset(), batch.reset(options=options)[0])
            np.testing.assert_array_equal(env.configuration, batch.configuration)

    def test_start_in_contact(self):
        env = sb3_vec_env(FLAT, 2)
        env.set_options([{}, {"start": [0.0, 2.4, 0.0, 0.0, 0.0, 0.0]}])
        with pytest.raises(StartInContactError, match="start 1"):
            env.reset()


class TestMisuse:
    def test_step_and_render_before_reset(self):
        env = sb3_vec_env(FLAT, 2)
        for use in (lambda: env.step(np.zeros((2, 5))), env.render):
            with pytest.raises(InvalidInputError, match="never begun"):
                use()


class TestAttributes:
    def test_arms_share_everything(self):
        env = sb3_vec_env(GOALS, NUMBER)
        assert env.get_attr("render_mode") == [None] * NUMBER
        assert env.get_attr("simulator", indices=[0, 3]) == [env.simulator] * 2
        assert env.get_attr("tells_terms", indices=2) == [False]
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


class TestReplay:
    """Episodes that begin where earlier ones ended without success, if that is asked for."""

    def play(self, env, steps=120):
        """Goals and infos of the episodes that end."""
        rng, ended = np.random.default_rng(1), []
        env.reset()
        for _ in range(steps):
            goals = env.episodes.goal.copy()
            infos = env.step(rng.uniform(-1, 1, (env.num_envs, 5)))[3]
            ended += [(tuple(goals[k]), info) for k, info in enumerate(infos) if "episode" in info]
        return ended

    @pytest.mark.parametrize("env_id", [FLAT, GOALS])
    def test_a_share_is_replayed_and_infos_say_so(self, env_id):
        env = sb3_vec_env(env_id, 20, seed=3, replay_share=0.5, horizon=12, tolerance=0.3)
        failed, replays = set(), []
        for goal, info in self.play(env):
            assert info["replayed"] == (goal in failed)
            replays.append(info["replayed"])
            if not info["is_success"]:
                failed.add(goal)
        assert 0.3 < np.mean(replays) < 0.6

    def test_what_failed_goes_on_elsewhere(self, tmp_path):
        """Saved by NumPy, given back through a wrapper, before or after a learner's seed."""
        env = sb3_vec_env(FLAT, 10, seed=4, replay_share=0.5)
        ended = self.play(env, 80)
        failed = [goal for goal, info in ended if not info["is_success"]]
        np.testing.assert_array_equal(env.failed.goals, failed)
        np.savez(tmp_path / "failed.npz", **env.failed._asdict())
        env.seed(7)
        env.restore_failed(*env.failed)
        wanted = self.play(env, 80)
        assert any(info["replayed"] for _, info in wanted[:10])
        for later in (False, True):
            other = sb3_vec_env(FLAT, 10, seed=None if later else 7, replay_share=0.5)
            with np.load(tmp_path / "failed.npz") as saved:
                VecFrameStack(other, 2).restore_failed(**saved)
            if later:
                other.seed(7)
            assert [goal for goal, _ in self.play(other, 80)] == [goal for goal, _ in wanted]
            np.testing.assert_array_equal(other.failed.starts, env.failed.starts)

    def test_failures_that_cannot_be_given_back(self):
        env, home = sb3_vec_env(FLAT, 2, replay_share=0.5), np.zeros((1, 6))
        with pytest.raises(InvalidInputError, match="starts"):
            env.restore_failed(home[:, :5], np.ones((1, 3)))
        with pytest.raises(InvalidInputError, match="lies outside the limits"):
            env.restore_failed(home + 9, np.ones((1, 3)))
        with pytest.raises(InvalidInputError, match="need an environment with a replay_share"):
            sb3_vec_env(FLAT, 2).restore_failed(home, np.ones((1, 3)))
