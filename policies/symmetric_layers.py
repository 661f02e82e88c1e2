"""A network and its mirror image in one: each acts on its side of the scene."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from kinarm.errors import InvalidInputError
from kinarm.policies.mirror import GOAL_Y, Mirror
from kinarm.policies.normalizer import input_scale
from kinarm.policies.policy import Layer

SATURATING = 100.0
"""Input of tanh, or more, that makes it 1 to the last bit."""
NEAREST_GOAL_Y = 0.05
"""Goals are told apart by side if they lie at least this far from the x-z plane [m]."""


def symmetric_layers(
    layers: tuple[Layer, ...],
    mean: NDArray[np.float64],
    std: NDArray[np.float64],
    mirror: Mirror,
) -> tuple[Layer, ...]:
    """Build layers that act as given for goals to the right, and as their image for the left.

    One unit of each hidden layer tells the side: -1 to the right, 1 to the left. It switches off
    the last hidden layer of the copy that is not concerned, that is, it drives all its units to
    exactly -1, which the biases of the last layer make up for.

    Parameters
    ----------
    layers : tuple of Layer
        At least three, with tanh between them.
    mean, std : ndarray, shape (n_observations,)
        Statistics by which their inputs are normalised.
    mirror : Mirror
        The reflection.

    Returns
    -------
    tuple of Layer
        For the same mean and std. Twice as wide, plus one unit.

    Raises
    ------
    InvalidInputError
        If there are fewer than two hidden layers.
    """
    if len(layers) < 3:
        raise InvalidInputError(
            f"a symmetric network needs at least two hidden layers, got {len(layers) - 1}"
        )
    return (
        _first_hidden(layers[0], mean, std, mirror),
        *(_next_hidden(layer) for layer in layers[1:-2]),
        _switched(_next_hidden(layers[-2]), layers[-2]),
        _last(layers[-1], mirror),
    )


def _first_hidden(
    layer: Layer, mean: NDArray[np.float64], std: NDArray[np.float64], mirror: Mirror
) -> Layer:
    """Both copies and the side; the second copy looks into the mirror."""
    signs, slope = mirror.observations, SATURATING / NEAREST_GOAL_Y
    shift = (signs * mean - mean) * input_scale(std)
    side = np.zeros(len(mean))
    side[GOAL_Y] = slope * std[GOAL_Y]
    return Layer(
        np.vstack([layer.weights, layer.weights * signs, side]),
        np.concatenate([layer.bias, layer.bias + layer.weights @ shift, [slope * mean[GOAL_Y]]]),
    )


def _next_hidden(layer: Layer) -> Layer:
    """Both copies side by side; the side stays what it is."""
    side = np.array([[SATURATING]])
    return Layer(
        block_diag(layer.weights, layer.weights, side),
        np.concatenate([layer.bias, layer.bias, [0.0]]),
    )


def _switched(doubled: Layer, layer: Layer) -> Layer:
    """Let the side drive the units of the copy that is not concerned to -1."""
    largest = np.abs(layer.weights).sum(axis=1) + np.abs(layer.bias)
    push = (largest + SATURATING) / 2
    weights, bias = doubled.weights.copy(), doubled.bias.copy()
    weights[:-1, -1] = np.concatenate([-push, push])
    bias[:-1] -= np.concatenate([push, push])
    return Layer(weights, bias)


def _last(layer: Layer, mirror: Mirror) -> Layer:
    """Sum of both copies, less what the one that is switched off contributes."""
    image = Layer(mirror.actions[:, None] * layer.weights, mirror.actions * layer.bias)
    right = layer.bias + image.weights.sum(axis=1)
    left = image.bias + layer.weights.sum(axis=1)
    side = (left - right) / 2
    return Layer(np.hstack([layer.weights, image.weights, side[:, None]]), (left + right) / 2)
