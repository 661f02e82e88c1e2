"""Points that are spread evenly over a cube."""

import numpy as np
from numpy.typing import NDArray


def evenly_spread(count: int, dimensions: int) -> NDArray[np.float64]:
    """Points of low discrepancy in the unit cube: multiples of powers of a root, modulo 1.

    The root solves x^(d + 1) = x + 1, which for d = 1 is the golden ratio (Roberts 2018).
    """
    root = 2.0
    for _ in range(64):
        root = (1.0 + root) ** (1.0 / (dimensions + 1))
    strides = root ** -np.arange(1.0, dimensions + 1)
    points: NDArray[np.float64] = (0.5 + np.arange(1, count + 1)[:, None] * strides) % 1.0
    return points
