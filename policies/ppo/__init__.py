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
    summaries={
        "paper": "what the paper says of PPO, and defaults",
        "tuned": "a good policy, in less than a minute of a core",
        "taught": "imitates the oracle first: a better one, in two minutes",
        "best": "the best that we found, in six minutes",
        "precise": "comes closest to the goal and stays there, in seven minutes",
    },
    adapt=adapted,
    begin=imported("kinarm.policies.ppo.learner", "PPOTraining"),
    policy=imported("kinarm.policies.ppo.networks", "actor_policy"),
    options=("tensorboard", "threads"),
)
