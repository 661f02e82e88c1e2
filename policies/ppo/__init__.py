"""Proximal Policy Optimization, for the registry of learners."""

from kinarm.policies.learners import imported
from kinarm.policies.ppo.config import PPOConfig
from kinarm.policies.ppo.state import PPOState
from kinarm.policies.recipes import shipped_learner

LEARNER = shipped_learner(
    "ppo",
    PPOConfig,
    title="Proximal Policy Optimization",
    state=PPOState,
    begin=imported("kinarm.policies.ppo.learner", "PPOTraining"),
    policy=imported("kinarm.policies.ppo.networks", "actor_policy"),
    options=("tensorboard", "threads"),
)
