"""Updates of actor and critic by Adam, and imitation of the oracle.

An actor may imitate the oracle first, since reinforcement spends most steps on finding the goals at
all. Imitation alone reaches far fewer goals: it never sees where its own errors lead.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm._parallel import SHARED_STEPS, run_together
from kinarm.errors import InvalidInputError
from kinarm.failed_scenarios import StartsAndGoals
from kinarm.policies.config import scheduled
from kinarm.policies.learners import CurvePoint
from kinarm.policies.normalizer import Normalizer, input_scale
from kinarm.policies.ppo import PPOConfig
from kinarm.policies.ppo.kernels.layers import Numbers
from kinarm.policies.ppo.kernels.update import (
    HALF_LOG_2_PI,
    LOSSES,
    Descent,
    Experience,
    Objective,
    add_gradients,
    descend,
    standardisation,
)
from kinarm.policies.ppo.networks import ActorCritic
from kinarm.simulator import Simulator

PARTS = 8
"""Parts of a minibatch whose gradients are found independently."""

ADAM = {"first_decay": 0.9, "second_decay": 0.999, "epsilon": 1e-5}
"""Settings of Adam, as in Stable-Baselines3."""


class UpdateRecords(NamedTuple):
    """Means over each minibatch, for logs, shape (n_minibatches,)."""

    policy_loss: NDArray[np.float64]
    value_loss: NDArray[np.float64]
    clipped: NDArray[np.float64]
    divergence: NDArray[np.float64]
    log_std: NDArray[np.float64]


def update(
    config: PPOConfig,
    iteration: int,
    networks: ActorCritic,
    moments: tuple[Numbers, Numbers],
    experience: Experience,
    rng: np.random.Generator,
    threads: int,
) -> UpdateRecords:
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
    descent = Descent(learning_rate, **ADAM, max_norm=config.max_grad_norm)
    steps_before = iteration * config.n_epochs * (n_steps // size)
    gradients = np.empty((PARTS, len(networks.weights)), dtype=np.float32)
    losses, records = np.empty((PARTS, LOSSES)), []
    for _ in range(config.n_epochs):
        for chosen in rng.permutation(n_steps).reshape(-1, size):
            standard = standardisation(chosen, experience.advantages)
            arrays = (experience, chosen, objective, standard, gradients, losses)
            nets = (networks.actor, networks.critic)
            find_gradients(threads, *nets, *arrays)
            records.append((*losses.sum(axis=0) * objective.share, networks.log_std.mean()))
            descend(*nets, *moments, gradients, descent, steps_before + len(records))
    return UpdateRecords(*np.array(records).T)


def logged(
    config: PPOConfig, point: CurvePoint, records: UpdateRecords, experience: Experience
) -> dict[str, float]:
    """Entries of a log, with the names of Stable-Baselines3.

    Parameters
    ----------
    config : PPOConfig
        The settings.
    point, records, experience
        Results of an iteration.
    """
    n_actions, minibatches = experience.actions.shape[1], len(records.log_std) // config.n_epochs
    entropy = n_actions * (records.log_std + 0.5 + HALF_LOG_2_PI)
    losses = records.policy_loss - config.ent_coef * entropy + config.vf_coef * records.value_loss
    unexplained = np.var(experience.advantages) / np.var(experience.returns)
    return {
        "rollout/ep_rew_mean": point.mean_return,
        "rollout/success_rate": point.success,
        "train/entropy_loss": -entropy.mean(),
        "train/policy_gradient_loss": records.policy_loss.mean(),
        "train/value_loss": records.value_loss.mean(),
        "train/approx_kl": records.divergence[-minibatches:].mean(),
        "train/clip_fraction": records.clipped.mean(),
        "train/loss": losses[-1],
        "train/explained_variance": 1.0 - unexplained,
        "train/std": np.exp(records.log_std[-1]),
    }


def find_gradients(threads: int, *given: Any) -> None:
    """Call ``add_gradients(part, part + 1, *given)`` for `PARTS` parts, on threads.

    The calling thread works, too, and does not wait for one that has not begun:
    processors may be busy.

    Parameters
    ----------
    threads : int
        Threads at most.
    *given
        Passed on to the kernel.
    """
    if threads == 1:
        add_gradients(0, PARTS, *given)
        return
    parts = iter(range(PARTS))  # each number goes to one thread: it holds the GIL

    def work(*_: object) -> int:
        for part in parts:
            add_gradients(part, part + 1, *given)
        return 0

    run_together(work, SHARED_STEPS, min(threads, PARTS), lambda _: None)


EPOCHS = 30
"""How often imitation uses each step."""

BATCH_SIZE = 512
"""Steps per gradient step."""

LEARNING_RATE = 1e-3
"""Initial step size of Adam; it falls linearly to zero."""


class Demonstrations(NamedTuple):
    """What was seen and done in motions of the oracle, one row a step."""

    observations: NDArray[np.float64]
    actions: NDArray[np.float64]


def demonstrate(
    simulator: Simulator, scenarios: StartsAndGoals, threads: int | None = None
) -> Demonstrations:
    """Let the oracle solve scenarios; unsolved ones are left out.

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
) -> None:
    """Change the actor so that its means come close to the actions shown.

    Parameters
    ----------
    networks : ActorCritic
        Networks, whose actor is changed.
    demonstrations, normalizer
        What is imitated, and statistics that normalise observations.
    rng : numpy.random.Generator
        Draws minibatches.
    threads : int
        Threads to use; the result does not depend on them.
    """
    seen = (demonstrations.observations - normalizer.mean) * input_scale(normalizer.std)
    shown = seen.astype(np.float32), demonstrations.actions.astype(np.float32)
    n_actions = demonstrations.actions.shape[1]
    experience = Experience(*shown, *np.empty((4, 0), dtype=np.float32))
    nets = (networks.actor, networks.critic)
    gradients = np.empty((PARTS, len(networks.weights)), dtype=np.float32)
    moments = np.zeros_like(networks.weights), np.zeros_like(networks.weights)
    losses = np.empty((PARTS, LOSSES))
    batches = max(1, len(seen) // BATCH_SIZE)
    for epoch in range(EPOCHS):
        for number, chosen in enumerate(np.array_split(rng.permutation(len(seen)), batches)):
            objective = Objective(0.0, 0.0, 0.0, 1.0 / (len(chosen) * n_actions), imitating=True)
            arrays = (experience, chosen, objective, (0.0, 1.0), gradients, losses)
            find_gradients(threads, *nets, *arrays)
            done = (epoch * batches + number) / (EPOCHS * batches)
            descent = Descent(LEARNING_RATE * (1 - done), 0.9, 0.999, 1e-8, 1e9)
            descend(*nets, *moments, gradients, descent, epoch * batches + number + 1)
