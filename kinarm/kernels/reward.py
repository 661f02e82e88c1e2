"""The reward of a step, term by term (paper, section 3.3: closer is positive, farther negative).

A new term is a field of `kinarm.task.RewardWeights` and its formula here, in the same order.
"""

from kinarm.kernels.compiling import Array, inlined
from kinarm.kernels.lanes import select

PROGRESS, CLOSER, STEP, COLLISION, SUCCESS = range(5)
"""Columns of the terms; from `COLLISION` on, they are paid when an episode ends."""


@inlined
def add_reward(
    weights: Array,
    before: float,
    after: float,
    collided: bool,
    reached: bool,
    terms: Array,
    total: Array,
    e: int,
) -> None:
    """Fill in the weighted terms of an episode's step, and add them to its return.

    ``before`` and ``after`` are the distances from the tool to the goal about the step [m].
    """
    sign = select(after < before, 1.0, select(after > before, -1.0, 0.0))
    terms[e, PROGRESS] = weights[PROGRESS] * (before - after)
    terms[e, CLOSER] = weights[CLOSER] * sign
    terms[e, STEP] = weights[STEP]
    terms[e, COLLISION] = select(collided, weights[COLLISION], 0.0)
    terms[e, SUCCESS] = select(reached, weights[SUCCESS], 0.0)
    of_every_step = terms[e, PROGRESS]
    for term in range(PROGRESS + 1, COLLISION):
        of_every_step += terms[e, term]
    total[e] += of_every_step
    for term in range(COLLISION, weights.shape[0]):
        total[e] += terms[e, term]
