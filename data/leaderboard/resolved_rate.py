"""Resolved-rate control: a damped step of inverse kinematics to the goal, blind to contact.

A policy that nobody trained, of the 48 numbers that the paper's policies see.
"""

import numpy as np
from numpy.typing import NDArray

from kinarm import Simulator

SIMULATOR = Simulator("both")
DAMPING = 0.01
"""Added to the squares of what a step of each joint moves the tool by [m]."""


def act(observations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Actions of observations, shape (n, 48), as one array, shape (n, 5)."""
    n, n_actions = len(observations), SIMULATOR.n_actions
    goals, errors = observations[:, :3], observations[:, 3:6]
    turns, origins = observations[:, 6:30].reshape(n, 6, 4), observations[:, 30:].reshape(n, 6, 3)
    axes = rotated(turns, SIMULATOR.arm.chain.axis)
    columns = np.cross(axes, (goals - errors)[:, None] - origins)[:, :n_actions]
    columns = columns * SIMULATOR.step_limit[:, None]
    squares = columns.swapaxes(1, 2) @ columns + DAMPING**2 * np.eye(3)
    actions: NDArray[np.float64] = (columns @ np.linalg.solve(squares, errors[..., None]))[..., 0]
    largest: NDArray[np.float64] = abs(actions).max(axis=1, keepdims=True)
    return actions / np.fmax(1.0, largest)


def rotated(quaternions: NDArray[np.float64], axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Axes that quaternions w, x, y, z turn, shape (..., 3)."""
    w, v = quaternions[..., :1], quaternions[..., 1:]
    across = np.cross(v, axes)
    turned: NDArray[np.float64] = axes + 2.0 * (w * across + np.cross(v, across))
    return turned
