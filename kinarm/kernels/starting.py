"""Kernels that draw starts: few numbers, for which calls of NumPy take longer than the sums."""

import math

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.compiling import Array, kernel


@kernel
def propose_starts(
    rows: NDArray[np.int64], uniforms: Array, lower: Array, extent: Array, starts: Array
) -> Array:
    """Place the first joints of some starts within their range, and return these starts.

    Uniform numbers in [0, 1) have the shape (n_rows, n_actuated).
    """
    proposed = np.empty((rows.shape[0], starts.shape[1]))
    for i in range(rows.shape[0]):
        for joint in range(uniforms.shape[1]):
            starts[rows[i], joint] = lower[joint] + uniforms[i, joint] * extent[joint]
        for joint in range(starts.shape[1]):
            proposed[i, joint] = starts[rows[i], joint]
    return proposed


@kernel
def rejected_rows(
    rows: NDArray[np.int64],
    goals: Array,
    tools: Array,
    touching: NDArray[np.bool_],
    tolerance: float,
) -> NDArray[np.int64]:
    """Rows of the starts that touch something or have their tool at the goal already."""
    rejected, count = np.empty_like(rows), 0
    for i in range(rows.shape[0]):
        e = rows[i]
        x, y, z = tools[i, 0] - goals[e, 0], tools[i, 1] - goals[e, 1], tools[i, 2] - goals[e, 2]
        if touching[i] or math.sqrt(x * x + y * y + z * z) <= tolerance:
            rejected[count] = e
            count += 1
    return rejected[:count]
