"""Bounds of the steps to goals, and of the distances from them, for the trials of a batch.

Each is a search of its own, or a few (`kinarm.policies.oracle.kernels.approach.search`).
"""

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.kernels.compiling import Array
from kinarm.policies.oracle.kernels.approach import ArmInScene, search
from kinarm.policies.oracle.kernels.boxes import ROUNDING, WAITING, Boxes, layout


def bound_steps(
    first: int,
    last: int,
    arm: ArmInScene,
    starts: Array,
    goals: Array,
    step_limit: Array,
    tolerance: float,
    contact: bool,
    budget: int,
    fewest: NDArray[np.int64],
    most: NDArray[np.int64],
    lower_bounds: NDArray[np.int64],
    tight: NDArray[np.bool_],
    witnesses: Array,
) -> None:
    """Prove how many steps it takes at least to bring the tool to goals, for some rows.

    Numbers of steps from ``fewest`` to ``most`` are examined; fewer than ``fewest`` are impossible.
    Written are ``lower_bounds``, below which no number of steps suffices; whether they are
    ``tight``, that is, some configuration that counts reaches the goal in so many steps, or none
    does in ``most``; and such configurations as ``witnesses``. A search may examine as many boxes
    as are in the budget.
    """
    best, limits = np.empty(starts.shape[1]), step_limit.copy()
    space = work_space(arm, len(step_limit))
    for row in range(first, last):
        start, goal = starts[row].copy(), (*goals[row].tolist(),)
        few, many, all_at_once = int(fewest[row]), int(most[row]), not contact
        lower_bounds[row], tight[row] = few, True
        while few <= many:
            limit = many if all_at_once else few
            box = within_steps(arm.chain, start, limits, limit)
            inputs = (arm, start, goal, limits, few, limit, tolerance, np.inf, contact, budget)
            complete, steps, _, _ = search(*inputs, *box, best, *space)
            if steps <= limit:
                witnesses[row] = best
            if complete:
                few = steps
            lower_bounds[row], tight[row] = few, complete
            if steps <= limit if complete else not all_at_once:
                break
            # All at once is least work, unless the budget is too small: then each number of steps
            # has one of its own, up to those that the configuration found takes. Where contact
            # counts, what is closest to the goal rarely counts, and larger boxes are harder.
            if all_at_once:
                many, all_at_once = steps - 1, False


def bound_distance(
    first: int,
    last: int,
    arm: ArmInScene,
    lower: Array,
    upper: Array,
    starts: Array,
    goals: Array,
    resolution: float,
    contact: bool,
    budget: int,
    distances: Array,
    configurations: Array,
) -> None:
    """Bound from below how close the tool can come to goals, for some rows.

    Written are the distances, shape (m, 2), proven and found [m], and the closest configurations
    found; joints beyond those of the boxes stay as in ``starts``.
    """
    n = lower.shape[1]
    unlimited, space = np.full(n, np.inf), work_space(arm, n)
    for row in range(first, last):
        box, goal = (lower[row].copy(), upper[row].copy()), (*goals[row].tolist(),)
        inputs = (arm, starts[row].copy(), goal, unlimited, n, n, 0.0, resolution, contact, budget)
        _, _, found, proven = search(*inputs, *box, configurations[row], *space)
        distances[row] = proven, found


def within_steps(chain: Chain, start: Array, step_limit: Array, steps: int) -> tuple[Array, Array]:
    """Corners of what the first joints can reach in some steps."""
    n, reach = len(step_limit), steps * step_limit + ROUNDING
    lower, upper = start[:n] - reach, start[:n] + reach
    return np.maximum(chain.lower[:n], lower), np.minimum(chain.upper[:n], upper)


def work_space(arm: ArmInScene, n: int) -> tuple[Array, Boxes]:
    """Space for the boxes of n joints that wait, and for those that are examined."""
    n_joints, n_shapes = len(arm.chain.lower), len(arm.shapes.link)
    return np.empty((WAITING, 2 * n + 1)), layout(n, n_joints, n_shapes).record()
