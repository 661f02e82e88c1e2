"""Proximal Policy Optimization, for the registry of learners."""

from pathlib import Path
from typing import TYPE_CHECKING

from kinarm.policies.learners import Learner, require_packages
from kinarm.policies.ppo.config import PPOConfig
from kinarm.policies.ppo.recipes import RECIPES
from kinarm.policies.ppo.state import PPOState

if TYPE_CHECKING:
    from kinarm.policies.policy import Policy
    from kinarm.policies.ppo.learner import PPOTraining


def _begin(config: PPOConfig, tensorboard: str | Path | None = None) -> "PPOTraining":
    if tensorboard is not None:
        require_packages(("tensorboard",), "ppo")
    from kinarm.policies.ppo.learner import PPOTraining

    return PPOTraining(config, tensorboard)


def _policy(config: PPOConfig, state: PPOState) -> "Policy":
    from kinarm.policies.ppo.actor import actor_policy

    return actor_policy(config, state)


LEARNER = Learner(
    name="ppo",
    title="Proximal Policy Optimization",
    config=PPOConfig,
    state=PPOState,
    recipes=RECIPES,
    begin=_begin,
    policy=_policy,
    options=("tensorboard",),
    packages=("torch", "stable_baselines3"),
    extra="ppo",
)
