"""Dense networks."""

import math

from kinarm.episodes import ELU, HARDTANH, LEAKY_RELU, LINEAR, RELU, SILU, TANH, Control
from kinarm.kernels.compiling import Array, helper, inlined

NARROW = 16
"""Layers of fewer outputs keep their sums in registers."""

LEAK = 0.01
"""Slope of the leaky rectifier below zero."""


@inlined
def narrow_layer(
    weights: Array,
    policy: int,
    offset: int,
    n_in: int,
    n_out: int,
    inputs: Array,
    source: int,
    outputs: Array,
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
    weights: Array,
    policy: int,
    offset: int,
    n_in: int,
    n_out: int,
    inputs: Array,
    source: int,
    outputs: Array,
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
def activate(kind: int, values: Array, row: int, n: int) -> None:
    """Apply an activation function to the first n entries of a row."""
    if kind == TANH:
        for j in range(n):
            values[row, j] = math.tanh(values[row, j])
    elif kind == RELU:
        for j in range(n):
            values[row, j] = max(values[row, j], 0.0)
    elif kind != LINEAR:
        activate_unusual(kind, values, row, n)


@helper
def activate_unusual(kind: int, values: Array, row: int, n: int) -> None:
    """Apply one of the functions that few policies have; called, it keeps `activate` short."""
    if kind == HARDTANH:
        for j in range(n):
            values[row, j] = min(max(values[row, j], -1.0), 1.0)
    elif kind == ELU:
        for j in range(n):
            if values[row, j] < 0.0:
                values[row, j] = math.expm1(values[row, j])
    elif kind == LEAKY_RELU:
        for j in range(n):
            if values[row, j] < 0.0:
                values[row, j] *= LEAK
    elif kind == SILU:
        for j in range(n):
            values[row, j] *= 0.5 + 0.5 * math.tanh(0.5 * values[row, j])


@inlined
def act(control: Control, observations: Array, e: int, work: Array, action: Array) -> None:
    """Let an episode's network choose its action.

    A network with a mirror has learnt goals on the right alone: for a goal on the left it is
    given the reflected observation, and its action is reflected in turn. The work space, shape
    (3, widest layer), holds two layers by turns, and a reflected observation.
    """
    layers, weights, policy = control.layers, control.weights, control.policy[e]
    activations, n_layers, offset = control.activations, layers.shape[0] - 1, 0
    signs = control.observation_signs
    reflected = signs.shape[0] > 0 and observations[e, control.side] > 0.0
    inputs, source = observations, e
    if reflected:
        inputs, source = work, 2
        for i in range(signs.shape[0]):
            work[2, i] = signs[i] * observations[e, i]
    for layer in range(n_layers):
        n_in, n_out = layers[layer], layers[layer + 1]
        sink = (layer + 1) % 2
        if n_out < NARROW:
            narrow_layer(weights, policy, offset, n_in, n_out, inputs, source, work, sink)
        else:
            wide_layer(weights, policy, offset, n_in, n_out, inputs, source, work, sink)
        activate(activations[layer], work, sink, n_out)
        inputs, source = work, sink
        offset += (n_in + 1) * n_out
    for j in range(action.shape[0]):
        action[j] = min(max(work[n_layers % 2, j], -1.0), 1.0)
        if reflected:
            action[j] *= control.action_signs[j]
