"""Steps of configurations that stay within limits, for a number or lanes."""

from kinarm.kernels.compiling import Array, inlined
from kinarm.kernels.lanes import any_lane, select

LONGEST_STEP = 0.5
"""Largest move of a joint in an iteration [rad or m]."""


@inlined
def take_out_blocked(q: Array, lower: Array, upper: Array, step: Array, jacobian: Array) -> bool:
    """Zero the Jacobian's columns of joints at a limit that would leave it; whether there is one.

    The others then have to make up for them, which changes the step.
    """
    blocked = False
    for k in range(step.shape[0]):
        outward = ((q[0, k] >= upper[k]) & (step[k] > 0.0)) | (
            (q[0, k] <= lower[k]) & (step[k] < 0.0)
        )
        if any_lane(outward):
            blocked = True
            for i in range(jacobian.shape[0]):
                jacobian[i, k] = select(outward, 0.0, jacobian[i, k])
    return blocked


@inlined
def take_step(q: Array, lower: Array, upper: Array, step: Array) -> float:
    """Move configurations by a step, within their limits; return its largest part [rad or m]."""
    # Scaled down as a whole, a step keeps its direction, in which the tool nears the goal.
    longest = 0.0 * step[0] + LONGEST_STEP
    for k in range(step.shape[0]):
        longest = max(longest, abs(step[k]))
    for k in range(step.shape[0]):
        moved = q[0, k] + LONGEST_STEP / longest * step[k]
        q[0, k] = min(max(moved, lower[k]), upper[k])
    return longest
