"""An update of actor and critic: some epochs of steps of Adam, each by a minibatch.

Before a training, an actor may imitate the oracle. Reinforcement spends most of its steps on
finding the goals at all, and the oracle's motions show where they are. Imitation alone reaches far
fewer goals than what follows: it never sees where its own errors lead.
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
"""Parts of a minibatch whose gradients are found independently of each other."""

ADAM = {"first_decay": 0.9, "second_decay": 0.999, "epsilon": 1e-5}
"""Settings of Adam, as Stable-Baselines3 chooses them."""


class UpdateRecords(NamedTuple):
    """Means over each minibatch, for logs; arrays of shape (n_minibatches,)."""

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

    A minibatch is split into parts whose gradients are added up in a fixed order, so that the
    result does not depend on the number of threads.

    Parameters
    ----------
    config, iteration : PPOConfig and int
        Settings, and how many updates there were before.
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
    """Entries of a log by name, which are those of Stable-Baselines3.

    Parameters
    ----------
    config : PPOConfig
        The settings.
    point, records, experience
        What an iteration came to.
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
    """Call ``add_gradients(part, part + 1, *given)`` for each of `PARTS` parts, on several threads.

    The calling thread works, too, and never waits for one that has not begun: where processors
    are busy with something else, it does all by itself.

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
    parts = iter(range(PARTS))  # whose next number only one thread gets: it holds the GIL

    def work(*_: object) -> int:
        for part in parts:
            add_gradients(part, part + 1, *given)
        return 0

    run_together(work, SHARED_STEPS, min(threads, PARTS), lambda _: None)


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
) -> None:
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
            steps = epoch * batches + number + 1
            descend(*nets, *moments, gradients, descent, steps)
