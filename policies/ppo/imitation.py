"""Imitation: an actor learns from motions of the oracle before its training begins.

Reinforcement spends most of its steps on finding the goals at all. The oracle's motions show where
they are. Imitation alone reaches far fewer goals than what follows: it never sees where its own
errors lead.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.errors import InvalidInputError
from kinarm.failed_scenarios import StartsAndGoals
from kinarm.policies.normalizer import Normalizer, input_scale
from kinarm.policies.ppo.kernels.update import Descent, add_imitation_gradients, descend
from kinarm.policies.ppo.networks import ActorCritic
from kinarm.policies.ppo.update import PARTS, run_parts
from kinarm.simulator import Simulator

EPOCHS = 30
"""How often imitation uses each step of the motions."""

BATCH_SIZE = 512
"""Steps per gradient step."""

LEARNING_RATE = 1e-3
"""Step size of Adam at the beginning; it falls linearly to zero."""


class Demonstrations(NamedTuple):
    """Steps of motions of the oracle: what was seen and done, one row a step."""

    observations: NDArray[np.float64]
    actions: NDArray[np.float64]


def demonstrate(
    simulator: Simulator, scenarios: StartsAndGoals, threads: int | None = None
) -> Demonstrations:
    """Let the oracle solve scenarios; those that it does not solve are left out.

    Parameters
    ----------
    simulator : Simulator
        What the oracle solves them in.
    scenarios : tuple of ndarray, shapes (n, n_joints) and (n, 3)
        Starts [rad or m] and goals [m].
    threads : int, optional
        As for `kinarm.policies.Oracle`.
    """
    from kinarm.policies.oracle import Oracle

    found = Oracle(simulator.problem, threads=threads).solve_batch(*scenarios)
    solved = [each for each in zip(found, scenarios[1], strict=True) if each[0].reachable]
    if not solved:
        raise InvalidInputError("the oracle finds no motion that could be imitated")
    paths = np.concatenate([solution.path[:-1] for solution, _ in solved])
    goals = np.concatenate([np.tile(goal, (solution.steps, 1)) for solution, goal in solved])
    actions = np.concatenate([solution.actions for solution, _ in solved])
    return Demonstrations(simulator.world.observe(paths, goals), actions)


def imitate(
    networks: ActorCritic,
    demonstrations: Demonstrations,
    normalizer: Normalizer,
    rng: np.random.Generator,
    threads: int,
) -> list[float]:
    """Change the actor so that its means come close to the actions; the critic stays as it is.

    Parameters
    ----------
    networks : ActorCritic
        Networks, of which the actor is changed.
    demonstrations, normalizer
        What is imitated, and how observations are normalised.
    rng : numpy.random.Generator
        Draws minibatches.
    threads : int
        Threads to use; the result does not depend on them.

    Returns
    -------
    list of float
        Mean squared error of the actions in each epoch.
    """
    seen = (demonstrations.observations - normalizer.mean) * input_scale(normalizer.std)
    arrays = seen.astype(np.float32), demonstrations.actions.astype(np.float32)
    gradients = np.empty((PARTS, len(networks.weights)), dtype=np.float32)
    moments = np.zeros_like(networks.weights), np.zeros_like(networks.weights)
    losses, errors = np.empty(PARTS), []
    batches = max(1, len(seen) // BATCH_SIZE)
    for epoch in range(EPOCHS):
        total = 0.0
        for number, chosen in enumerate(np.array_split(rng.permutation(len(seen)), batches)):
            given = (networks.actor, *arrays, chosen, gradients, losses)
            run_parts(add_imitation_gradients, threads, *given)
            done = (epoch * batches + number) / (EPOCHS * batches)
            descent = Descent(LEARNING_RATE * (1 - done), 0.9, 0.999, 1e-8, 1e9)
            steps = epoch * batches + number + 1
            descend(networks.actor, networks.critic, *moments, gradients, descent, steps)
            total += losses.sum()
        errors.append(total / demonstrations.actions.size)
    return errors
