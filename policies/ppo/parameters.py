"""Parameters of actor and critic in one vector, as Stable-Baselines3 orders them."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.errors import InvalidInputError

HIDDEN_GAIN, ACTOR_GAIN, CRITIC_GAIN = 2.0**0.5, 0.01, 1.0
"""Factors of orthogonal initial weights, as Stable-Baselines3 chooses them."""

Vector = NDArray[Any]
Affine = tuple[Vector, Vector]
"""Weights, shape (n_out, n_in), and bias, shape (n_out,)."""


class Parameters(NamedTuple):
    """Parts of a vector.

    Attributes
    ----------
    log_std : ndarray, shape (n_actions,)
        Logarithms of the standard deviations of the actions.
    actor, critic : list of tuple of ndarray
        Layer by layer the weights, shape (n_out, n_in), and the bias, shape (n_out,).
    """

    log_std: Vector
    actor: list[Affine]
    critic: list[Affine]


def split_parameters(
    vector: Vector, n_observations: int, net_arch: Sequence[int], n_actions: int
) -> Parameters:
    """Take a vector apart, whose parts are then views of it.

    The order is that of Stable-Baselines3: standard deviations, hidden layers of actor and critic,
    last layers of actor and critic; of every layer the weights come first.

    Raises
    ------
    InvalidInputError
        If it has another length.
    """
    hidden = list(pairwise((n_observations, *net_arch)))
    widths = [*hidden, *hidden, (net_arch[-1], n_actions), (net_arch[-1], 1)]
    sizes = [n_actions, *(size for n_in, n_out in widths for size in (n_in * n_out, n_out))]
    if len(vector) != sum(sizes):
        raise InvalidInputError(f"expected a state of {sum(sizes)} parameters, got {len(vector)}")
    log_std, *parts = np.split(vector, np.cumsum(sizes)[:-1])
    layers = [
        (weights.reshape(n_out, n_in), bias)
        for (n_in, n_out), weights, bias in zip(widths, parts[::2], parts[1::2], strict=True)
    ]
    count = len(hidden)
    return Parameters(log_std, [*layers[:count], layers[-2]], [*layers[count:-2], layers[-1]])


def initial_parameters(
    rng: np.random.Generator,
    n_observations: int,
    net_arch: Sequence[int],
    n_actions: int,
    log_std: float,
) -> NDArray[np.float32]:
    """Draw parameters as Stable-Baselines3 does: orthogonal weights, and biases of zero."""
    widths = [n_observations, *net_arch]
    inner = sum((n_in + 1) * n_out for n_in, n_out in pairwise(widths))
    vector = np.zeros(2 * inner + (n_actions + 1) * (net_arch[-1] + 1) + n_actions)
    parts = split_parameters(vector, n_observations, net_arch, n_actions)
    parts.log_std[:] = log_std
    for layers, gain in ((parts.actor, ACTOR_GAIN), (parts.critic, CRITIC_GAIN)):
        for weights, _ in layers:
            weights[:] = HIDDEN_GAIN * orthogonal(rng.standard_normal(weights.shape))
        layers[-1][0][:] *= gain / HIDDEN_GAIN
    return vector.astype(np.float32)


def orthogonal(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Make the columns, or the rows if there are fewer, of a matrix orthonormal one by one.

    Of a matrix of normal numbers it makes a matrix that is as likely as any of its rotations. The
    sums are taken in a fixed order, not by BLAS, whose order depends on the processor.
    """
    if normal.shape[0] >= normal.shape[1]:
        return _orthonormal_rows(normal.T).T
    return _orthonormal_rows(normal)


def _orthonormal_rows(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Subtract from each row what the earlier ones hold of it (Gram and Schmidt)."""
    found = normal.copy()
    for k, row in enumerate(found):
        for _ in range(2):  # once more, against rounding
            along = (found[:k] * row).sum(axis=1)
            row -= (along[:, None] * found[:k]).sum(axis=0)
        row /= np.sqrt((row * row).sum())
    return found
