"""Dense networks."""

import math

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.compiling import inlined

NARROW = 16
"""Layers of fewer outputs keep their sums in registers."""


@inlined
def narrow_layer(
    weights: NDArray[np.float64],
    policy: int,
    offset: int,
    n_in: int,
    n_out: int,
    inputs: NDArray[np.float64],
    source: int,
    outputs: NDArray[np.float64],
    sink: int,
) -> None:
    """Apply an affine layer of few outputs: sums stay in registers, five at a time."""
    bias = offset + n_in * n_out
    blocked = n_out - n_out % 5
    for j in range(0, blocked, 5):
        s0, s1 = weights[policy, bias + j], weights[policy, bias + j + 1]
        s2, s3 = weights[policy, bias + j + 2], weights[policy, bias + j + 3]
        s4 = weights[policy, bias + j + 4]
        entry = offset + j
        for i in range(n_in):
            value = inputs[source, i]
            s0 += value * weights[policy, entry]
            s1 += value * weights[policy, entry + 1]
            s2 += value * weights[policy, entry + 2]
            s3 += value * weights[policy, entry + 3]
            s4 += value * weights[policy, entry + 4]
            entry += n_out
        outputs[sink, j], outputs[sink, j + 1], outputs[sink, j + 2] = s0, s1, s2
        outputs[sink, j + 3], outputs[sink, j + 4] = s3, s4
    for j in range(blocked, n_out):
        s0 = weights[policy, bias + j]
        for i in range(n_in):
            s0 += inputs[source, i] * weights[policy, offset + i * n_out + j]
        outputs[sink, j] = s0


@inlined
def wide_layer(
    weights: NDArray[np.float64],
    policy: int,
    offset: int,
    n_in: int,
    n_out: int,
    inputs: NDArray[np.float64],
    source: int,
    outputs: NDArray[np.float64],
    sink: int,
) -> None:
    """Apply an affine layer of many outputs: the loop over outputs fills vector registers."""
    for j in range(n_out):
        outputs[sink, j] = weights[policy, offset + n_in * n_out + j]
    for i in range(n_in):
        value = inputs[source, i]
        for j in range(n_out):
            outputs[sink, j] += value * weights[policy, offset + i * n_out + j]


@inlined
def dense(
    layers: NDArray[np.int64],
    weights: NDArray[np.float64],
    policy: int,
    observations: NDArray[np.float64],
    row: int,
    hidden: NDArray[np.float64],
    action: NDArray[np.float64],
) -> None:
    """Evaluate a network: tanh between layers, output clipped to [-1, 1].

    Parameters
    ----------
    layers : ndarray of int, shape (n_layers + 1,)
        Widths.
    weights : ndarray, shape (n_policies, n_parameters)
        Layer after layer: weights (inputs x outputs), then the bias.
    policy : int
        Which row of ``weights``.
    observations : ndarray, shape (n, n_observations)
        Inputs.
    row : int
        Which row of ``observations``.
    hidden : ndarray, shape (2, widest layer)
        Work space.
    action : ndarray, shape (n_actions,)
        The output.
    """
    offset = 0
    n_layers = layers.shape[0] - 1
    for layer in range(n_layers):
        n_in, n_out = layers[layer], layers[layer + 1]
        sink = (layer + 1) % 2
        inputs, source = (observations, row) if layer == 0 else (hidden, layer % 2)
        if n_out < NARROW:
            narrow_layer(weights, policy, offset, n_in, n_out, inputs, source, hidden, sink)
        else:
            wide_layer(weights, policy, offset, n_in, n_out, inputs, source, hidden, sink)
        if layer < n_layers - 1:
            for j in range(n_out):
                hidden[sink, j] = math.tanh(hidden[sink, j])
        offset += (n_in + 1) * n_out
    for j in range(action.shape[0]):
        action[j] = min(max(hidden[n_layers % 2, j], -1.0), 1.0)
