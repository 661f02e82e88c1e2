"""Normal random numbers that perturb policies."""

import math

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.lanes import LANES
from kinarm.policies.ars.kernels import normal_pairs


def perturbations(rng: np.random.Generator, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Draw independent standard normal numbers, the same bits on every machine.

    Those of NumPy's generator depend on the C library's logarithm.
    """
    count = math.prod(shape)
    half = -(-count // 2)
    numbers = np.zeros((2, -(-half // LANES) * LANES))
    numbers[:, :half] = rng.random((2, half))
    normal_pairs(numbers.reshape(2, -1, LANES))
    return numbers[:, :half].reshape(-1)[:count].reshape(shape)
