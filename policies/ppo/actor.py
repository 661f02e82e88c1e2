"""The actor of a PPO training as a policy that needs neither torch nor Stable-Baselines3."""

import numpy as np

from kinarm.policies.mirror import task_mirror
from kinarm.policies.policy import Layer, Policy
from kinarm.policies.ppo.config import PPOConfig
from kinarm.policies.ppo.parameters import split_parameters
from kinarm.policies.ppo.state import PPOState
from kinarm.policies.provenance import Provenance
from kinarm.world import World


def actor_policy(config: PPOConfig, state: PPOState) -> Policy:
    """Freeze the actor of a state into a policy, which takes its mean action.

    Raises
    ------
    InvalidInputError
        If the state has another number of parameters than such a training.
    """
    world = World(config.problem, threads=1)
    return Policy(
        mean=state.normalizer.mean,
        std=state.normalizer.std,
        layers=actor_layers(config, state, world.n_observations, world.n_actions),
        provenance=Provenance.of("ppo", config, state.environment_steps),
        mirror=task_mirror(config.symmetric, world),
    )


def actor_layers(
    config: PPOConfig, state: PPOState, n_observations: int, n_actions: int
) -> tuple[Layer, ...]:
    """Cut the actor's layers out of the parameters."""
    parameters = state.parameters.astype(np.float64)
    parts = split_parameters(parameters, n_observations, config.net_arch, n_actions)
    return tuple(Layer(weights, bias) for weights, bias in parts.actor)
