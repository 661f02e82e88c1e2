"""The actor of a PPO training as a policy, which needs none of the packages of the training."""

from itertools import pairwise

import numpy as np

from kinarm.errors import InvalidInputError
from kinarm.policies.mirror import task_mirror
from kinarm.policies.policy import Layer, Policy
from kinarm.policies.ppo.config import PPOConfig
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
    """Cut the actor's layers out of the parameters.

    Their order is that of Stable-Baselines3: standard deviations of the actions, hidden layers of
    actor and critic, last layers of actor and critic; of every layer the weights come first.
    """
    hidden = list(pairwise((n_observations, *config.net_arch)))
    actor_end, critic_end = (config.net_arch[-1], n_actions), (config.net_arch[-1], 1)
    widths = [*hidden, *hidden, actor_end, critic_end]
    sizes = [n_actions, *(size for n_in, n_out in widths for size in (n_in * n_out, n_out))]
    if len(state.parameters) != sum(sizes):
        raise InvalidInputError(
            f"expected a state of {sum(sizes)} parameters, got {len(state.parameters)}"
        )
    parts = np.split(state.parameters.astype(np.float64), np.cumsum(sizes)[:-1])[1:]
    layers = [
        Layer(weights.reshape(n_out, n_in), bias)
        for (n_in, n_out), weights, bias in zip(widths, parts[::2], parts[1::2], strict=True)
    ]
    return (*layers[: len(hidden)], layers[-2])
