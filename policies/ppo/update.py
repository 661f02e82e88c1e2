"""Updates of actor and critic by Adam."""

import itertools

import numpy as np

from kinarm._parallel import BALANCED_STEPS, run_rows
from kinarm.policies.config import scheduled
from kinarm.policies.ppo import PPOConfig
from kinarm.policies.ppo.kernels.layers import Numbers
from kinarm.policies.ppo.kernels.update import (
    Descent,
    Experience,
    Objective,
    add_gradients,
    descend,
    standardisation,
)
from kinarm.policies.ppo.networks import ActorCritic

PARTS = 8
"""Parts of a minibatch whose gradients are found independently."""


def update(
    config: PPOConfig,
    iteration: int,
    networks: ActorCritic,
    moments: tuple[Numbers, Numbers],
    experience: Experience,
    rng: np.random.Generator,
    threads: int,
) -> None:
    """Change networks and moments by the experience of a rollout.

    Gradients of parts are added up in a fixed order, so that the result does
    not depend on threads.

    Parameters
    ----------
    config, iteration : PPOConfig and int
        Settings, and number of earlier updates.
    networks : ActorCritic
        What is trained.
    moments : tuple of ndarray of float32
        Adam's two moments, laid out like the weights; changed.
    experience : Experience
        What is learnt from.
    rng : numpy.random.Generator
        Draws minibatches.
    threads : int
        Threads that share the parts.
    """
    n_steps, size = config.steps_per_iteration, config.batch_size
    objective = Objective(config.clip_range, config.ent_coef, config.vf_coef, 1.0 / size)
    done = iteration / config.iterations
    learning_rate = scheduled(config.learning_rate, config.learning_rate_schedule, done)
    descent = Descent(learning_rate, config.max_grad_norm)
    steps_before = iteration * config.n_epochs * (n_steps // size)
    gradients = np.empty((PARTS, len(networks.weights)), dtype=np.float32)
    nets = (networks.actor, networks.critic)
    passes = (rng.permutation(n_steps).reshape(-1, size) for _ in range(config.n_epochs))
    minibatches = itertools.chain.from_iterable(passes)
    for step, chosen in enumerate(minibatches, start=steps_before + 1):
        standard = standardisation(chosen, experience.advantages)
        given = (*nets, experience, chosen, objective, standard, gradients)
        run_rows(add_gradients, PARTS, BALANCED_STEPS, threads, *given)
        descend(*nets, *moments, gradients, descent, step)
