"""Updates of actor and critic by Adam."""

import itertools
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm._parallel import SHARED_STEPS, run_together
from kinarm.policies.config import scheduled
from kinarm.policies.learners import CurvePoint
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
    most = np.inf if config.target_kl is None else 1.5 * config.target_kl
    passes = (rng.permutation(n_steps).reshape(-1, size) for _ in range(config.n_epochs))
    for chosen in itertools.chain.from_iterable(passes):
        standard = standardisation(chosen, experience.advantages)
        arrays = (experience, chosen, objective, standard, gradients, losses)
        nets = (networks.actor, networks.critic)
        _find_gradients(threads, *nets, *arrays)
        means = losses.sum(axis=0) * objective.share
        if means[UpdateRecords._fields.index("divergence")] > most:
            break
        records.append((*means, networks.log_std.mean()))
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
    n_actions = experience.actions.shape[1]
    minibatches = config.steps_per_iteration // config.batch_size
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


def _find_gradients(threads: int, *given: Any) -> None:
    """Call ``add_gradients(part, part + 1, *given)`` for `PARTS` parts, on threads.

    The calling thread works, too, and does not wait for one that has not begun: processors may be
    busy.
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
