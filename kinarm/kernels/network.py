"""Actions of a block of episodes, by dense networks or from a table."""

import numpy as np
from numba import types
from numpy.typing import NDArray

from kinarm.episodes import ELU, HARDTANH, LEAKY_RELU, LINEAR, RELU, SILU, TANH, Control
from kinarm.kernels.compiling import Array, Stage, call_stage, helper, inlined, lean_kernel
from kinarm.kernels.elementary import hyperbolic_tangent
from kinarm.kernels.lanes import as_numbers, select
from kinarm.kernels.session import ACT, Session

LEAK = 0.01
"""Slope of the leaky rectifier below zero."""

KEPT, APPROACH, PASSES, LEAST_SQUARE = 0.005, 0.5, 10, 1e-9
"""Distance that links keep from bodies [m], largest share of what is beyond it that a step takes,
passes over all links, and what is added to the square of slopes."""


@helper
def affine_layer(
    weights: Array,
    offset: int,
    n_in: int,
    n_out: int,
    inputs: Array,
    source: int,
    outputs: Array,
    sink: int,
) -> None:
    """Apply an affine layer, with five sums at a time in registers."""
    bias = offset + n_in * n_out
    blocked = n_out - n_out % 5
    for j in range(0, blocked, 5):
        s0 = weights[bias + j]
        s1 = weights[bias + j + 1]
        s2 = weights[bias + j + 2]
        s3 = weights[bias + j + 3]
        s4 = weights[bias + j + 4]
        entry = offset + j
        for i in range(n_in):
            value = inputs[source, i]
            s0 += value * weights[entry]
            s1 += value * weights[entry + 1]
            s2 += value * weights[entry + 2]
            s3 += value * weights[entry + 3]
            s4 += value * weights[entry + 4]
            entry += n_out
        outputs[sink, j], outputs[sink, j + 1], outputs[sink, j + 2] = s0, s1, s2
        outputs[sink, j + 3], outputs[sink, j + 4] = s3, s4
    for j in range(blocked, n_out):
        s0 = weights[bias + j]
        for i in range(n_in):
            s0 += inputs[source, i] * weights[offset + i * n_out + j]
        outputs[sink, j] = s0


@helper
def activate(kind: int, values: Array, row: int, n: int) -> None:
    """Apply an activation function to the first n entries of a row."""
    for j in range(n if kind != LINEAR else 0):
        x = values[row, j]
        if kind == TANH:
            values[row, j] = hyperbolic_tangent(x)
        elif kind == RELU:
            values[row, j] = max(x, 0.0)
        elif kind == HARDTANH:
            values[row, j] = min(max(x, -1.0), 1.0)
        elif kind == ELU:
            t = hyperbolic_tangent(0.5 * min(x, 0.0))
            values[row, j] = select(x < 0.0, 2.0 * t / (1.0 - t), x)
        elif kind == LEAKY_RELU:
            values[row, j] = select(x < 0.0, LEAK * x, x)
        elif kind == SILU:
            values[row, j] = x * (0.5 + 0.5 * hyperbolic_tangent(0.5 * x))


@helper
def act(
    layers: NDArray[np.int64],
    activations: NDArray[np.int64],
    weights: Array,
    inputs: Array,
    hidden: Array,
    action: Array,
) -> None:
    """Let a network choose an action, shape (1, n_actions), for inputs, shape (1, n_inputs).

    Layers, activations and weights, numbers or lanes of own ones, are those of
    `kinarm.episodes.Control`. ``hidden`` holds two layers by turns.
    """
    n_layers, offset = layers.shape[0] - 1, 0
    for layer in range(n_layers):
        n_in, n_out, sink = layers[layer], layers[layer + 1], layer % 2
        if layer == 0:
            affine_layer(weights, offset, n_in, n_out, inputs, 0, hidden, sink)
        else:
            affine_layer(weights, offset, n_in, n_out, hidden, 1 - sink, hidden, sink)
        activate(activations[layer], hidden, sink, n_out)
        offset += (n_in + 1) * n_out
    for j in range(action.shape[1]):
        action[0, j] = hidden[(n_layers - 1) % 2, j]


@helper
def add_to_rates(seen: Array, rates: int, action: Array) -> None:
    """Add outputs of a network to the step of resolved-rate control, by its longest entry.

    So they fade within the last step to the goal, and cannot keep the arm from it.
    """
    longest = 0.0 * seen[0, rates]
    for axis in range(action.shape[1]):
        longest = max(longest, abs(seen[0, rates + axis]))
    for axis in range(action.shape[1]):
        action[0, axis] = seen[0, rates + axis] + longest * action[0, axis]


@helper
def keep_away(seen: Array, e: int, near: int, n_links: int, actions: Array) -> None:
    """Clip an action of a row, and turn it off bodies that links come too near to.

    Of what is beyond ``KEPT`` of a link's distance, a step takes ``APPROACH`` at most (Faverjon and
    Tournassoud 1987). Each pass projects the action so for one link after the other. ``near`` is
    the first entry of ``proximity`` in the observation.
    """
    n_joints, nothing = actions.shape[1], 0.0 * seen[e, near]
    for number in range(PASSES + 1):
        for link in range(n_links if number > 0 else 0):
            first = near + (4 + n_joints) * link
            along, square = nothing, nothing + LEAST_SQUARE
            for k in range(n_joints):
                slope = seen[e, first + 4 + k]
                along, square = along + slope * actions[e, k], square + slope * slope
            lack = max(APPROACH * (KEPT - seen[e, first]) - along, 0.0) / square
            for k in range(n_joints):
                actions[e, k] += lack * seen[e, first + 4 + k]
        for k in range(n_joints):
            actions[e, k] = min(max(actions[e, k], -1.0), 1.0)


@lean_kernel
def turn_away(seen: Array, near: int, n_links: int, actions: Array) -> None:
    """Turn actions, shape (n, n_actuated), off bodies; see `keep_away`."""
    for e in range(actions.shape[0]):
        keep_away(seen, e, near, n_links, actions)


@inlined
def shared_policy(n_episodes: int, control: Control) -> int:
    """Policy of all episodes; -1 if there are several, 0 with a table."""
    if control.layers.shape[0] == 0 or n_episodes == 0:
        return 0
    for e in range(1, n_episodes):
        if control.policy[e] != control.policy[0]:
            return -1
    return control.policy[0]


def _act(session: Session, shared: int) -> int:
    """Fill in the actions of a block by networks; ``shared`` is that of `shared_policy`."""
    control, block = session.control, session.block
    layers, activations, signs = control.layers, control.activations, control.observation_signs
    # Networks with a mirror know goals on the right alone: observations of goals on the left are
    # reflected, and so are the actions.
    reflected = block.observation[0, control.side] > 0.0
    for i in range(signs.shape[0]):
        given = block.observation[0, i]
        block.seen[0, i] = select(reflected, signs[i] * given, given)
    seen = block.seen if signs.shape[0] > 0 else block.observation
    if shared >= 0:
        act(layers, activations, control.weights[shared], seen, block.hidden, block.action)
    else:
        act(layers, activations, block.weights[0], seen, block.hidden, block.action)
    if block.newton.shape[0] > 0 and control.rates >= 0:
        add_to_rates(seen, control.rates, block.action)
    for axis in range(control.action_signs.shape[0]):
        action = block.action[0, axis]
        block.action[0, axis] = select(reflected, action * control.action_signs[axis], action)
    if block.newton.shape[0] > 0 and control.rates >= 0 and session.rules.near >= 0:
        keep_away(block.observation, 0, session.rules.near, block.q.shape[1], block.action)
    return 0


ACT_BY_NETWORKS = Stage(_act, types.int64)


@inlined
def choose_actions(shared: int, row: NDArray[np.int64], session: Session) -> None:
    """Fill in the actions of a block.

    ``shared`` is that of `shared_policy`, and ``row`` has the block's episodes, -1 for none.
    """
    control, block = session.control, session.block
    if control.layers.shape[0] > 0:
        call_stage(session.stages[ACT], (session, shared))
    else:
        held, steps = as_numbers(block.action), as_numbers(block.steps)
        for lane in range(row.shape[0]):
            if row[lane] >= 0:
                column = int(steps[0, lane]) if control.actions.shape[1] > 1 else 0
                for axis in range(held.shape[1]):
                    held[0, axis, lane] = control.actions[row[lane], column, axis]
    for axis in range(block.action.shape[1]):
        block.action[0, axis] = min(max(block.action[0, axis], -1.0), 1.0)
