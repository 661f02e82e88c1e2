"""What Stable-Baselines3 and sb3-contrib offer works on the environments, as its users write it."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import EvalCallback, StopTrainingOnRewardThreshold
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import (
    SubprocVecEnv,
    VecMonitor,
    VecNormalize,
    VecVideoRecorder,
)

from kinarm.policies import sb3_vec_env

FLAT = "kinarm/ReachRight-v0"


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

    def test_a_learner_from_an_id(self):
        model = PPO("MlpPolicy", FLAT, **rollouts(1))
        assert model.learn(64).num_timesteps == 64

    def test_environments_in_processes(self):
        """Those import kinarm themselves, as the prefix asks for."""
        env = make_vec_env(f"kinarm:{FLAT}", n_envs=2, vec_env_cls=SubprocVecEnv)
        assert PPO("MlpPolicy", env, **rollouts(2)).learn(64).num_timesteps == 64
        env.close()


def test_what_sb3_contrib_has_besides():
    contrib = pytest.importorskip("sb3_contrib")
    assert contrib.CrossQ("MlpPolicy", sb3_vec_env(FLAT, 4), **replays()).learn(256)
    env = sb3_vec_env(FLAT, 4)
    assert contrib.ARS("LinearPolicy", env, n_delta=2, n_eval_episodes=4).learn(500)


class TestWrappers:
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
