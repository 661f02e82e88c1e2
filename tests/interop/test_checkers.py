"""Checkers of Gymnasium and Stable-Baselines3 accept every environment, without a warning."""

import gymnasium
import pytest
from gymnasium.utils.env_checker import check_env

from kinarm.envs import ENVIRONMENTS


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("env_id", ENVIRONMENTS)
def test_gymnasium(env_id, dtype):
    env = gymnasium.make(env_id, observation_dtype=dtype)
    check_env(env.unwrapped, skip_render_check=True)


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("env_id", ENVIRONMENTS)
def test_stable_baselines3(env_id, dtype):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(gymnasium.make(env_id, observation_dtype=dtype).unwrapped)
