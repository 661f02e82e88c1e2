"""Settings of PPO, which need none of its packages."""

import subprocess
import sys

import pytest

from kinarm.errors import InvalidInputError
from kinarm.policies import PPOConfig
from kinarm.problem import PROBLEMS
from kinarm.task import RewardWeights


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"n_envs": 0}, "n_envs must be a whole number of at least 1, got 0"),
        ({"batch_size": 300}, "batch_size must be above 1 and divide the 2000 steps"),
        ({"net_arch": ()}, "net_arch must name at least one layer"),
        ({"training_tolerance": 0}, "training_tolerance must be greater than 0, got 0"),
        ({"ent_coef": -1}, "ent_coef must not be negative, got -1"),
        ({"replay_log_std": -1.0}, "replay_log_std needs a replay_share above 0"),
        ({"learning_rate_schedule": "cosine"}, "constant, linear, got 'cosine'"),
    ],
)
def test_bad_settings_are_refused(settings, words):
    with pytest.raises(InvalidInputError, match=words):
        PPOConfig(**settings)


def test_noise_is_learnt_or_falls_to_the_end():
    assert PPOConfig(log_std_init=-1.0).log_std_at(0.5) is None
    config = PPOConfig(log_std_init=-1.0, final_log_std=-3.0)
    assert [config.log_std_at(done) for done in (0, 0.45, 0.9, 1)] == pytest.approx(
        [-1, -2, -3, -3]
    )


def test_training_differs_from_the_problem_in_reward_and_tolerance():
    problem = PROBLEMS["left"].replace(arm="paper_flange", horizon=9, start_spread=0.5)
    reward = RewardWeights(collision=-3, success=2, step=-0.5)
    config = PPOConfig(problem=problem, training_tolerance=0.02, reward=reward)
    trained = config.simulator().problem
    assert trained == problem.replace(tolerance=0.02, reward=reward)
    assert config.problem == problem


def test_without_the_extra_everything_works():
    code = """
import sys
sys.modules["torch"] = sys.modules["stable_baselines3"] = None
import kinarm.policies as policies
for name in policies.__all__:
    getattr(policies, name)
changes = {"iterations": 1, "n_steps": 2, "batch_size": 32, "seed": 1}
print(policies.train_policy(policies.recipe("ppo", **changes)).policy)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("Policy(ppo paper*")
