"""The gradient of imitation: how an actor's means differ from actions that are to be imitated."""

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.compiling import kernel
from kinarm.policies.ppo.kernels.layers import (
    BLOCK,
    OUTPUTS,
    Network,
    backward,
    forward,
    load_sample,
    padded,
    whole_tiles,
    widest,
    work_length,
)
from kinarm.policies.ppo.kernels.tiles import Numbers


@kernel
def add_imitation_gradients(
    first: int,
    last: int,
    actor: Network,
    observations: Numbers,
    actions: Numbers,
    chosen: NDArray[np.int64],
    gradients: Numbers,
    losses: NDArray[np.float64],
) -> None:
    """Find the gradient of the mean squared error, in parts that do not depend on threads.

    Parameters
    ----------
    first, last : int
        Which parts.
    actor : Network
        The actor; other weights in its array get derivatives of zero.
    observations : ndarray of float32, shape (n, n_observations)
        What was seen.
    actions : ndarray of float32, shape (n, n_actions)
        What was done.
    chosen : ndarray of int, shape (batch_size,)
        Rows of the minibatch.
    gradients : ndarray of float32, shape (n_parts, n_weights)
        Where the derivatives by the weights go.
    losses : ndarray, shape (n_parts,)
        Where the sums of squared errors go.
    """
    layers, n_parts, n_actions = actor.layers, gradients.shape[0], actions.shape[1]
    sink, wide = layers[layers.shape[0] - 1, OUTPUTS], padded(n_actions)
    weight = 2.0 / (len(chosen) * n_actions)
    work = np.zeros(work_length(layers), dtype=np.float32)
    behind = np.zeros((BLOCK + 1) * widest(layers), dtype=np.float32)
    for part in range(first, last):
        gradient = gradients[part]
        gradient[:] = np.float32(0.0)
        losses[part] = 0.0
        begin, end = part * len(chosen) // n_parts, (part + 1) * len(chosen) // n_parts
        for start in range(begin, end, BLOCK):
            rows = chosen[start : min(start + BLOCK, end)]
            samples, tiled = len(rows), whole_tiles(len(rows))
            for s in range(samples):
                load_sample(observations, rows[s], layers, work, s)
            forward(actor, tiled, work)
            for s in range(samples):
                for j in range(n_actions):
                    error = float(work[sink + s * wide + j]) - actions[rows[s], j]
                    losses[part] += error * error
                    work[sink + s * wide + j] = weight * error
            backward(actor, tiled, samples, work, behind, gradient)
