"""Settings of environments: spaces that follow from them, and specifications that keep them."""

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from kinarm.envs.reach import ReachEnv
from kinarm.errors import InvalidInputError, ProblemError, UnknownNameError
from kinarm.problem import ReachProblem
from kinarm.scene import GoalRegion, Scene
from kinarm.task import RewardWeights

HOME = np.zeros(6)


class TestSpaces:
    def test_are_those_of_the_table(self, env):
        assert env.action_space == gymnasium.spaces.Box(-1, 1, (5,), np.float32)
        assert env.observation_space.dtype == np.float64
        task, reach = env.simulator.task, env.simulator.arm.reach
        region = env.simulator.scene.goal_region("right")
        margin = np.full(3, task.tolerance)
        lower, upper = env.observation_space.low, env.observation_space.high
        np.testing.assert_allclose(lower[:3], region.lower - margin)
        np.testing.assert_allclose(upper[:3], region.upper + margin)
        np.testing.assert_allclose(lower[3:6], region.lower - margin - reach)
        np.testing.assert_allclose(upper[3:6], region.upper + margin + reach)
        np.testing.assert_allclose([lower[30:], upper[30:]], [[-reach] * 18, [reach] * 18])

    def test_follow_the_goal_regions(self):
        thick = GoalRegion(name="thick", lower=(0.2, -0.2, 0.2), upper=(0.6, 0.2, 0.9))
        scene = Scene(obstacles=(), goal_regions=(thick, *Scene().goal_regions))
        env = ReachEnv("left", scene=scene, goal_regions=("thick", "left"), tolerance=0.1)
        np.testing.assert_allclose(env.observation_space.low[:3], [-0.6, -0.3, 0.1])
        np.testing.assert_allclose(env.observation_space.high[:3], [0.7, 0.85, 1.0])
        for seed in range(20):
            assert env.observation_space.contains(env.reset(seed=seed)[0])

    def test_follow_the_arm(self, mesh_arm):
        env = ReachEnv("both", arm=mesh_arm)
        assert env.observation_space.shape == (6 + 7 * 4,)
        assert env.action_space.shape == (4,)
        observation, _ = env.reset(seed=0)
        assert env.observation_space.contains(observation)


class TestSettings:
    def test_keyword_overrides(self):
        env = gymnasium.make(
            "kinarm/ReachLeft-v0",
            arm="lrmate200ic_5l",
            reward={"success": 2.0, "step": -0.1},
            start_spread=0.0,
            horizon=3,
            tolerance=0.01,
        ).unwrapped
        assert env.simulator.arm.name == "lrmate200ic_5l"
        task = env.simulator.task
        assert (task.horizon, task.tolerance, task.start_spread) == (3, 0.01, 0)
        assert task.reward == RewardWeights(success=2, step=-0.1)
        env.reset(seed=0)
        np.testing.assert_array_equal(env.simulator.arm.home, np.zeros(6))
        results = [env.step(np.zeros(5)) for _ in range(3)]
        assert results[-1][3]
        assert results[0][1] == pytest.approx(-0.1)

    @pytest.mark.parametrize("make", [gymnasium.make, gymnasium.make_vec])
    def test_settings_survive_the_spec(self, make):
        problem = ReachProblem.load("left").replace(horizon=7, scene=Scene(ground=False))
        settings = {"problem": problem.to_json(), "reward": {"success": 1.0}}
        env = make("kinarm/ReachBoth-v0", **settings, observation_dtype="float32")
        again = make(EnvSpec.from_json(env.spec.to_json()))
        assert again.unwrapped.simulator.problem == env.unwrapped.simulator.problem
        assert again.observation_space == env.observation_space

    def test_shorter_time_limit_of_gymnasium(self):
        env = gymnasium.make("kinarm/ReachBoth-v0", max_episode_steps=3)
        env.reset(seed=0)
        assert [env.step(np.zeros(5))[3] for _ in range(3)] == [False, False, True]
        assert env.spec.max_episode_steps == 3

    @pytest.mark.parametrize("dtype", ["float32", np.float32, "float64", np.dtype(np.float64)])
    def test_type_of_observations(self, dtype):
        env, exact = ReachEnv(observation_dtype=dtype), ReachEnv()
        assert env.observation_space.dtype == np.dtype(dtype)
        for made in (env, exact):
            made.reset(seed=2)
        shown, expected = (made.step(np.full(5, 0.3))[0] for made in (env, exact))
        assert shown.dtype == np.dtype(dtype)
        np.testing.assert_array_equal(shown, expected.astype(dtype))

    def test_actions_are_not_rounded(self, env):
        """The space is float32, as learners expect; finer actions are taken as they are."""
        ends = []
        for action in (1 / 3, np.float64(1 / 3), np.float32(1 / 3)):
            env.reset(options={"start": HOME, "goal": [0, 5, 5]})
            ends.append(env.step(np.full(5, action))[0])
        np.testing.assert_array_equal(ends[0], ends[1])
        assert 0 < np.abs(ends[2] - ends[0]).max() < 1e-7

    @pytest.mark.parametrize(
        ("settings", "error", "message"),
        [
            ({"problem": "up"}, UnknownNameError, "'up'"),
            ({"horizons": 3}, TypeError, "keyword argument 'horizons': .* available"),
            ({"reward": {"collision": 1}}, ProblemError, "rewards contact"),
            ({"horizon": 0}, InvalidInputError, "horizon"),
            ({"observation_dtype": "int8"}, InvalidInputError, "observation_dtype must be one of"),
        ],
    )
    def test_bad_settings_are_refused(self, settings, error, message):
        with pytest.raises(error, match=message):
            ReachEnv(**settings)
