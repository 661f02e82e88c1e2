"""Proximal Policy Optimization, for the registry of learners."""

from kinarm.policies.learners import Learner, imported
from kinarm.policies.ppo.config import PPOConfig
from kinarm.policies.ppo.recipes import RECIPES, adapted
from kinarm.policies.ppo.state import PPOState

LEARNER = Learner(
    name="ppo",
    title="Proximal Policy Optimization",
    config=PPOConfig,
    state=PPOState,
    recipes=RECIPES,
    adapt=adapted,
    begin=imported("kinarm.policies.ppo.learner", "PPOTraining"),
    policy=imported("kinarm.policies.ppo.actor", "actor_policy"),
    options=("tensorboard", "threads"),
    packages=("torch", "stable_baselines3"),
    extra="ppo",
)
