"""What Stable-Baselines3 and sb3-contrib offer works on the environments, as its users write it."""

import gymnasium
import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from stable_baselines3 import A2C, DDPG, PPO, SAC, TD3, HerReplayBuffer
from stable_baselines3.common.callbacks import EvalCallback, StopTrainingOnRewardThreshold
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import (
    SubprocVecEnv,
    VecFrameStack,
    VecMonitor,
    VecNormalize,
    VecVideoRecorder,
)

from kinarm.policies import sb3_vec_env

FLAT, GOALS = "kinarm/ReachRight-v0", "kinarm/ReachGoalRight-v0"


def small(**settings):
    """Settings of a network that learns at once; learners change what they are given."""
    return {"policy_kwargs": {"net_arch": [16]}, "device": "cpu", "seed": 0, **settings}


def rollouts(n_envs=4):
    """Settings of a short training of PPO."""
    return small(n_steps=32, batch_size=16 * n_envs, n_epochs=2)


def replays(**settings):
    """Settings of a short training with a replay buffer."""
    return small(buffer_size=1000, learning_starts=100, batch_size=32, **settings)


class TestFirstLines:
    """What is typed first."""

    @pytest.mark.parametrize("env_id", [FLAT, "kinarm/ReachLeft-v0", "kinarm/ReachBoth-v0"])
    def test_a_learner_from_an_id(self, env_id):
        model = PPO("MlpPolicy", env_id, **rollouts(1))
        assert model.learn(64).num_timesteps == 64

    def test_many_environments_from_an_id(self):
        env = make_vec_env(FLAT, n_envs=8)
        model = PPO("MlpPolicy", env, **rollouts(8)).learn(256)
        assert model.num_timesteps == 256

    def test_environments_in_processes(self):
        """Those import kinarm themselves, as the prefix asks for."""
        env = make_vec_env(f"kinarm:{FLAT}", n_envs=2, vec_env_cls=SubprocVecEnv)
        assert PPO("MlpPolicy", env, **rollouts(2)).learn(64).num_timesteps == 64
        env.close()


class TestLearners:
    @pytest.mark.parametrize("algorithm", [PPO, A2C])
    def test_on_policy(self, algorithm):
        for env, policy in ((FLAT, "MlpPolicy"), (GOALS, "MultiInputPolicy")):
            model = algorithm(policy, sb3_vec_env(env, 4), **small(n_steps=16)).learn(128)
            assert model.num_timesteps == 128

    @pytest.mark.parametrize("algorithm", [SAC, TD3, DDPG])
    def test_off_policy(self, algorithm):
        model = algorithm("MlpPolicy", sb3_vec_env(FLAT, 4), **replays()).learn(200)
        assert model.num_timesteps == 200
        assert model._n_updates > 0

    @pytest.mark.parametrize("name", ["TQC", "TRPO", "CrossQ"])
    def test_those_of_sb3_contrib(self, name):
        algorithm = getattr(pytest.importorskip("sb3_contrib"), name)
        settings = small(n_steps=32) if name == "TRPO" else replays()
        assert algorithm("MlpPolicy", sb3_vec_env(FLAT, 4), **settings).learn(256)

    def test_augmented_random_search_of_sb3_contrib(self):
        algorithm = pytest.importorskip("sb3_contrib").ARS
        model = algorithm("LinearPolicy", sb3_vec_env(FLAT, 4), n_delta=2, n_eval_episodes=4)
        model.learn(500)


class TestHindsight:
    @pytest.mark.parametrize("name", ["SAC", "TD3", "TQC"])
    @pytest.mark.parametrize("reward_type", ["sparse", "dense"])
    def test_hindsight_replay(self, name, reward_type):
        package = "sb3_contrib" if name == "TQC" else "stable_baselines3"
        algorithm = getattr(pytest.importorskip(package), name)
        env = sb3_vec_env(GOALS, 4, horizon=12, reward_type=reward_type)
        model = algorithm("MultiInputPolicy", env, **replays(replay_buffer_class=HerReplayBuffer))
        model.learn(300)
        samples = model.replay_buffer.sample(200)
        achieved = samples.next_observations["achieved_goal"].numpy().astype(np.float64)
        desired = samples.next_observations["desired_goal"].numpy().astype(np.float64)
        distance = np.linalg.norm(achieved - desired, axis=1)
        sparse = np.where(distance <= 0.05, 0.0, -1.0)
        rewards = samples.rewards.numpy()[:, 0]
        expected = sparse if reward_type == "sparse" else -distance
        besides = rewards - expected  # what collisions cost, if anything
        assert (np.isclose(besides, 0, atol=1e-6) | np.isclose(besides, -1, atol=1e-6)).all()
        assert np.isclose(besides, 0, atol=1e-6).mean() > 0.8
        assert (sparse == 0).any()  # some goals are relabelled to what was reached

    def test_saved_buffer_goes_on(self, tmp_path):
        def make():
            env = sb3_vec_env(GOALS, 2, horizon=12)
            return SAC("MultiInputPolicy", env, **replays(replay_buffer_class=HerReplayBuffer))

        model, other = make(), make()
        model.learn(200)
        model.save_replay_buffer(tmp_path / "buffer.pkl")
        other.load_replay_buffer(tmp_path / "buffer.pkl", truncate_last_traj=False)
        assert other.learn(200).num_timesteps == 200


class TestWrappers:
    def test_normalisation_is_saved_and_loaded(self, tmp_path):
        env = VecNormalize(sb3_vec_env(FLAT, 4, seed=0))
        PPO("MlpPolicy", env, **rollouts()).learn(128)
        env.save(str(tmp_path / "statistics.pkl"))
        loaded = VecNormalize.load(str(tmp_path / "statistics.pkl"), sb3_vec_env(FLAT, 2))
        np.testing.assert_array_equal(loaded.obs_rms.mean, env.obs_rms.mean)
        assert loaded.reset().shape == (2, 48)
        assert env.get_original_obs().shape == (4, 48)

    def test_normalisation_of_goals(self):
        env = VecNormalize(sb3_vec_env(GOALS, 4, horizon=12), norm_obs_keys=["observation"])
        settings = replays(replay_buffer_class=HerReplayBuffer)
        assert SAC("MultiInputPolicy", env, **settings).learn(200).num_timesteps == 200

    def test_monitor_writes_episodes(self, tmp_path):
        with pytest.warns(UserWarning, match="overwritten by the `VecMonitor` ones"):
            env = VecMonitor(
                sb3_vec_env(FLAT, 4, seed=0, horizon=5),
                str(tmp_path / "log"),
                info_keywords=("is_success", "distance"),
            )
        env.reset()
        told = []
        for _ in range(5):
            infos = env.step(np.zeros((4, 5)))[3]
            told += [info["episode"] for info in infos if info]
        env.close()
        assert [episode["l"] for episode in told] == [5] * 4
        lines = (tmp_path / "log.monitor.csv").read_text().splitlines()
        assert '"env_id": "kinarm/ReachRight-v0"' in lines[0]
        assert lines[1] == "r,l,t,is_success,distance"
        assert len(lines) == 6

    def test_frames_are_stacked(self):
        env = VecFrameStack(sb3_vec_env(FLAT, 3, horizon=4), n_stack=2)
        first = env.reset()
        assert first.shape == (3, 96)
        for _ in range(4):
            observations, _, dones, infos = env.step(np.zeros((3, 5)))
        assert dones.all()
        assert infos[0]["terminal_observation"].shape == (96,)
        np.testing.assert_array_equal(observations[:, :48], 0)

    def test_a_film_is_recorded(self, tmp_path):
        pytest.importorskip("moviepy")
        size = {"width": 64, "height": 48, "render_mode": "rgb_array"}
        env = sb3_vec_env(FLAT, 3, seed=0, **size)
        env = VecVideoRecorder(env, str(tmp_path), lambda step: step == 0, video_length=8)
        env.reset()
        for _ in range(8):
            env.step(np.ones((3, 5)))
        assert env.render().shape == (2 * 48, 2 * 64, 3)
        env.close()
        (film,) = tmp_path.glob("*.mp4")
        assert film.stat().st_size > 500


class TestEvaluation:
    def test_evaluate_policy_needs_no_monitor(self):
        env = sb3_vec_env(FLAT, 4, seed=0, horizon=6)
        model = PPO("MlpPolicy", env, **rollouts())
        returns, lengths = evaluate_policy(model, env, 12, return_episode_rewards=True)
        assert len(returns) == 12
        assert max(lengths) <= 6

    def test_returns_are_those_of_the_single_environments(self):
        model = PPO("MlpPolicy", sb3_vec_env(FLAT, 3), **rollouts(3))
        many = sb3_vec_env(FLAT, 3, seed=5)
        single = make_vec_env(FLAT, 3, seed=5, env_kwargs={"observation_dtype": "float32"})
        found, expected = (
            evaluate_policy(model, env, 9, return_episode_rewards=True) for env in (many, single)
        )
        np.testing.assert_allclose(found[0], expected[0], atol=1e-6)
        assert found[1] == expected[1]

    def test_callback_reports_success(self, tmp_path):
        env = VecNormalize(sb3_vec_env("right", 4, seed=0, tolerance=0.6))
        check = VecNormalize(sb3_vec_env("right", 2, seed=1, tolerance=0.6))
        check.training = False
        stop = StopTrainingOnRewardThreshold(-10.0)
        callback = EvalCallback(
            check,
            callback_on_new_best=stop,
            eval_freq=16,
            n_eval_episodes=10,
            deterministic=False,
            log_path=str(tmp_path),
            best_model_save_path=str(tmp_path),
            verbose=0,
        )
        model = PPO("MlpPolicy", env, **rollouts()).learn(10_000, callback=callback)
        assert model.num_timesteps == 64  # any return is above the threshold
        log = np.load(tmp_path / "evaluations.npz")
        assert log["successes"].shape == (1, 10)
        assert log["successes"].any()
        assert (tmp_path / "best_model.zip").exists()


def test_saved_model_acts_on_both_kinds_of_environments(tmp_path):
    model = PPO("MlpPolicy", sb3_vec_env(FLAT, 4, seed=0), **rollouts()).learn(128)
    model.save(tmp_path / "model.zip")
    for env in (sb3_vec_env(FLAT, 2), gymnasium.make(FLAT, observation_dtype="float32")):
        loaded = PPO.load(tmp_path / "model.zip", env=env)
        observations = env.reset() if env is loaded.env else np.zeros((3, 48), dtype=np.float32)
        actions, expected = (
            each.predict(observations, deterministic=True)[0] for each in (loaded, model)
        )
        np.testing.assert_array_equal(actions, expected)
