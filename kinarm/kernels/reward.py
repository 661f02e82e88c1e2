"""The reward of a step, term by term (paper, section 3.3: closer is positive, farther negative).

A new term is a field of `kinarm.task.RewardWeights` and its formula here, in the same order.
"""

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.compiling import inlined

PROGRESS, CLOSER, STEP, COLLISION, SUCCESS = range(5)
"""Columns of the terms; from `COLLISION` on, they are paid when an episode ends."""


@inlined
def add_reward(
    weights: NDArray[np.float64],
    before: float,
    after: float,
    collided: bool,
    reached: bool,
    terms: NDArray[np.float64],
    total: NDArray[np.float64],
    e: int,
) -> None:
    """Fill in the weighted terms of an episode's step, and add them to its return.

    Parameters
    ----------
    weights : ndarray, shape (n_terms,)
        Weights of the terms.
    before, after : float
        Distance from the tool to the goal before and after the step [m].
    collided, reached : bool
        How the step ended.
    terms : ndarray, shape (n_episodes, n_terms)
        Output: the weighted terms.
    total : ndarray, shape (n_episodes,)
        Sums of rewards.
    e : int
        Episode.
    """
    terms[e, PROGRESS] = weights[PROGRESS] * (before - after)
    terms[e, CLOSER] = weights[CLOSER] * ((after < before) - (after > before))
    terms[e, STEP] = weights[STEP]
    terms[e, COLLISION] = weights[COLLISION] if collided else 0.0
    terms[e, SUCCESS] = weights[SUCCESS] if reached else 0.0
    of_every_step = 0.0
    for term in range(COLLISION):
        of_every_step += terms[e, term]
    total[e] += of_every_step
    for term in range(COLLISION, weights.shape[0]):
        total[e] += terms[e, term]
