"""The hyperparameters for rl-zoo3: files that ship, complete, and made of what exists."""

import inspect

import pytest

from kinarm._files import shipped_files
from kinarm.envs import ENVIRONMENTS

NAMED = {name for name in ENVIRONMENTS if not name.endswith(("/Reach-v0", "/ReachGoal-v0"))}
"""Environments of one problem; those of any have no settings that fit all."""

FLAT = {name for name in NAMED if "Goal" not in name}
GOALS = NAMED - FLAT
ALGORITHMS = {
    "ppo": FLAT,
    "a2c": FLAT,
    "sac": FLAT | GOALS,
    "td3": FLAT | GOALS,
    "tqc": FLAT | GOALS,
}
OF_THE_ZOO = {"n_timesteps", "policy", "normalize", "env_kwargs", "monitor_kwargs", "n_envs"}
NOISE = {"noise_type", "noise_std"}
SHIPPED = shipped_files("zoo", ".yml")


def test_each_algorithm_has_a_file():
    assert set(SHIPPED) == set(ALGORITHMS)


@pytest.mark.parametrize(("algorithm", "environments"), ALGORITHMS.items())
def test_every_environment_has_settings(algorithm, environments):
    yaml = pytest.importorskip("yaml")
    settings = yaml.safe_load(SHIPPED[algorithm].read_text(encoding="utf-8"))
    assert set(settings) == environments


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_settings_are_those_of_the_algorithm(algorithm):
    yaml = pytest.importorskip("yaml")
    zoo = pytest.importorskip("rl_zoo3")
    known = set(inspect.signature(zoo.ALGOS[algorithm]).parameters) | OF_THE_ZOO | NOISE
    for settings in yaml.safe_load(SHIPPED[algorithm].read_text("utf-8")).values():
        assert set(settings) <= known
