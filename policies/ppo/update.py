"""An update of actor and critic: some epochs of steps of Adam, each by a minibatch."""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.policies.ppo.kernels.loss import LOSSES, Experience, Objective
from kinarm.policies.ppo.kernels.tiles import Numbers
from kinarm.policies.ppo.kernels.update import Descent, add_gradients, descend, standardisation
from kinarm.policies.ppo.networks import ActorCritic

PARTS = 8
"""Parts of a minibatch whose gradients are found independently of each other."""


class UpdateRecords(NamedTuple):
    """Means over each minibatch; arrays of shape (n_minibatches,).

    Attributes
    ----------
    policy_loss, value_loss : ndarray
        Parts of the loss.
    clipped : ndarray
        Share of probability ratios that were clipped.
    divergence : ndarray
        Divergence of the policy from that of the rollout.
    log_std : ndarray
        Logarithm of the standard deviation of the actions.
    """

    policy_loss: NDArray[np.float64]
    value_loss: NDArray[np.float64]
    clipped: NDArray[np.float64]
    divergence: NDArray[np.float64]
    log_std: NDArray[np.float64]


def update(
    networks: ActorCritic,
    moments: tuple[Numbers, Numbers],
    experience: Experience,
    epochs: Iterable[NDArray[np.int64]],
    objective: Objective,
    descent: Descent,
    *,
    steps_before: int,
    threads: int,
) -> UpdateRecords:
    """Change networks and moments by the experience of a rollout.

    A minibatch is split into parts whose gradients are added up in a fixed order, so that the
    result does not depend on the number of threads.

    Parameters
    ----------
    networks : ActorCritic
        What is trained.
    moments : tuple of ndarray of float32
        Adam's two moments, laid out like the weights; changed.
    experience : Experience
        What is learnt from.
    epochs : iterable of ndarray of int, shape (n_minibatches, batch_size)
        Rows of the experience, minibatch after minibatch.
    objective, descent
        The loss, and how it is descended.
    steps_before : int
        Steps of Adam in earlier updates.
    threads : int
        Threads that share the parts.
    """
    gradients = np.empty((PARTS, len(networks.weights)), dtype=np.float32)
    losses, records = np.empty((PARTS, LOSSES)), []
    for minibatches in epochs:
        for chosen in minibatches:
            standard = standardisation(chosen, experience.advantages)
            arrays = (experience, chosen, objective, standard, gradients, losses)
            nets = (networks.actor, networks.critic)
            run_parts(add_gradients, PARTS, threads, *nets, *arrays)
            records.append((*losses.sum(axis=0) * objective.share, networks.log_std.mean()))
            descend(*nets, *moments, gradients, descent, steps_before + len(records))
    return UpdateRecords(*np.array(records).T)


def run_parts(kernel: Callable[..., None], n_parts: int, threads: int, *arrays: Any) -> None:
    """Call ``kernel(part, part + 1, *arrays)`` for every part, on several threads.

    The calling thread works, too, and never waits for one that has not begun: where processors
    are busy with something else, it does all by itself. Kernels release the GIL and treat parts
    independently, so the result does not depend on who did what.

    Parameters
    ----------
    kernel : callable
        Called with the first part, the one after the last, and the arrays.
    n_parts : int
        Number of parts.
    threads : int
        Threads at most.
    *arrays
        What the kernel reads and writes.
    """
    parts = iter(range(n_parts))  # whose next number only one thread gets: it holds the GIL

    def work() -> None:
        for part in parts:
            kernel(part, part + 1, *arrays)

    helpers = min(threads, n_parts) - 1
    if helpers == 0:
        kernel(0, n_parts, *arrays)
        return
    pool = _helpers(os.getpid(), helpers)
    helping = [pool.submit(work) for _ in range(helpers)]
    work()
    for helper in helping:
        if not helper.cancel():
            helper.result()


@cache
def _helpers(process: int, count: int) -> ThreadPoolExecutor:
    """A pool per process, since threads do not survive a fork."""
    return ThreadPoolExecutor(count, thread_name_prefix=f"kinarm-ppo-{process}")
