"""How a block of episodes gets its actions: from a table, or by networks."""

import numpy as np
from numpy.typing import NDArray

from kinarm.episodes import Control
from kinarm.kernels.block import Block
from kinarm.kernels.compiling import inlined
from kinarm.kernels.lanes import as_numbers, select
from kinarm.kernels.network import act


@inlined
def shared_policy(n_episodes: int, control: Control) -> int:
    """The policy of all episodes; -1 if they have several, 0 if they have a table."""
    if control.layers.shape[0] == 0 or n_episodes == 0:
        return 0
    for e in range(1, n_episodes):
        if control.policy[e] != control.policy[0]:
            return -1
    return control.policy[0]


@inlined
def choose_actions(control: Control, shared: int, row: NDArray[np.int64], block: Block) -> None:
    """Fill in the actions of a block.

    ``shared`` is what `shared_policy` returned, and ``row`` tells which episodes are in the block,
    -1 where there is none.
    """
    layers, activations, signs = control.layers, control.activations, control.observation_signs
    reflected = block.observation[0, control.side] > 0.0
    if layers.shape[0] == 0:
        look_up(row, control, block)
    else:
        mirrored = signs.shape[0] > 0
        if mirrored:
            see(reflected, control, block)
        seen = block.seen if mirrored else block.observation
        if shared >= 0:
            weights = control.weights[shared]
            act(layers, activations, weights, seen, block.hidden, block.action)
        else:
            act(layers, activations, block.weights, seen, block.hidden, block.action)
    for axis in range(block.action.shape[1]):
        action = min(max(block.action[0, axis], -1.0), 1.0)
        if signs.shape[0] > 0:
            action = select(reflected, action * control.action_signs[axis], action)
        block.action[0, axis] = action


@inlined
def look_up(row: NDArray[np.int64], control: Control, block: Block) -> None:
    """Take the actions of a block from the table."""
    action, steps = as_numbers(block.action), as_numbers(block.steps)
    for lane in range(row.shape[0]):
        if row[lane] >= 0:
            column = int(steps[0, lane]) if control.actions.shape[1] > 1 else 0
            for axis in range(action.shape[1]):
                action[0, axis, lane] = control.actions[row[lane], column, axis]


@inlined
def see(reflected: bool, control: Control, block: Block) -> None:
    """Fill in what networks with a mirror see, given where they see it in there.

    Such a network has learnt goals on the right alone: for a goal on the left it is given the
    reflected observation, and its action is reflected in turn.
    """
    signs = control.observation_signs
    for i in range(signs.shape[0]):
        given = block.observation[0, i]
        block.seen[0, i] = select(reflected, signs[i] * given, given)
