"""Settings of PPO, which need none of its packages."""

import subprocess
import sys
from dataclasses import FrozenInstanceError

import pytest

from kinarm.errors import InvalidInputError
from kinarm.policies import PPOConfig


def test_default_is_as_long_as_the_papers_training():
    assert PPOConfig().environment_steps == 1_200_000


def test_numbers_follow_from_others():
    config = PPOConfig(arms=6, rollout_steps=10, minibatch=20, iterations=7)
    assert (config.steps_per_iteration, config.environment_steps) == (60, 420)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"arms": 0}, "arms must be a whole number of at least 1, got 0"),
        ({"iterations": 2.5}, "iterations"),
        ({"seed": -1}, "seed"),
        ({"epochs": True}, "epochs"),
        ({"minibatch": 300}, "minibatch must be above 1 and divide the 2000 steps"),
        ({"minibatch": 1}, "minibatch"),
        ({"hidden": ()}, "hidden must name at least 1 layers, got 0"),
        ({"hidden": (64, 0)}, "hidden"),
        ({"hidden": (64,), "symmetric": True}, "at least 2 layers, got 1"),
        ({"learning_rate": 0}, "learning_rate must be greater than 0, got 0"),
        ({"learning_rate": float("inf")}, "learning_rate"),
        ({"clip_range": -0.1}, "clip_range"),
        ({"max_grad_norm": 0}, "max_grad_norm"),
        ({"tolerance": 0}, "tolerance"),
        ({"gamma": 1.5}, r"gamma must lie in \[0, 1\], got 1.5"),
        ({"gae_lambda": float("nan")}, "gae_lambda"),
        ({"start_spread": 1.5}, r"start_spread must lie in \[0, 1\], got 1.5"),
        ({"initial_start_spread": -0.1}, "initial_start_spread"),
        ({"widening": 2}, "widening"),
        ({"entropy_weight": -1}, "entropy_weight must not be negative, got -1"),
        ({"value_weight": float("nan")}, "value_weight"),
        ({"initial_log_std": float("inf")}, "initial_log_std must be finite"),
        ({"learning_rate_schedule": "cosine"}, "constant, linear, got 'cosine'"),
    ],
)
def test_bad_settings_are_refused(settings, words):
    with pytest.raises(InvalidInputError, match=words):
        PPOConfig(**settings)


def test_is_frozen_and_comparable():
    config = PPOConfig(hidden=[64, 64])
    assert config == PPOConfig(hidden=(64, 64))
    with pytest.raises(FrozenInstanceError):
        config.gamma = 0.5


def test_learning_rate():
    assert PPOConfig(learning_rate=0.01).learning_rate_at(0.25) == 0.01
    falling = PPOConfig(learning_rate=0.01, learning_rate_schedule="linear")
    assert [falling.learning_rate_at(done) for done in (0, 0.75)] == [0.01, 0.0025]


def test_simulator_has_the_settings():
    simulator = PPOConfig(
        task="left",
        arm="paper_flange",
        horizon=9,
        tolerance=0.02,
        start_spread=0.5,
        collision_penalty=-3,
        success_bonus=2,
        step_reward=-0.5,
    ).simulator()
    task = simulator.task
    assert (task.name, simulator.arm.name, task.horizon) == ("left", "paper_flange", 9)
    assert (task.tolerance, task.start_spread) == (0.02, 0.5)
    assert (task.reward.collision, task.reward.success, task.reward.step) == (-3, 2, -0.5)
    assert task.reward.progress == 1


@pytest.mark.parametrize("package", ["torch", "stable_baselines3"])
def test_without_the_extra_everything_but_training_works(package):
    code = f"""
import sys
from importlib.machinery import ModuleSpec
from types import ModuleType
for name in ("torch", "stable_baselines3"):  # the other one is there, wherever this runs
    sys.modules[name] = ModuleType(name)
    sys.modules[name].__spec__ = ModuleSpec(name, None)
sys.modules[{package!r}] = None
import kinarm.policies as policies
for name in policies.__all__:
    getattr(policies, name)
from kinarm.errors import MissingExtraError
try:
    policies.train_policy(policies.recipe("ppo", "tuned"))
except MissingExtraError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == f"{package} is not installed: pip install 'kinarm[ppo]'\n"
