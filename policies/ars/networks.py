"""Small networks as policies of Augmented Random Search, with tanh between the layers.

All parameters are in one row, in the order of `kinarm.Networks`.
"""

import math
from collections.abc import Iterator, Sequence
from itertools import chain, pairwise

import numpy as np
from numpy.typing import NDArray

from kinarm.errors import InvalidInputError
from kinarm.kernels.lanes import LANES
from kinarm.networks import Networks
from kinarm.observation import part_slices
from kinarm.policies.ars.kernels import normal_pairs
from kinarm.policies.normalizer import Normalizer, fold_normalizer
from kinarm.policies.policy import Layer, Policy

Numbers = NDArray[np.float64]

DEVIATION = 1.5
"""Standard deviation of what a unit of the first layer adds up to, for normalised observations."""


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


def first_deviations(n_joints: int) -> Numbers:
    """Standard deviations of the first layer's initial weights, shape (n_observations,).

    All parts of the observation have the same say: else the few entries of the goal would drown.
    """
    parts = list(part_slices(n_joints).values())
    sizes = np.array([part.stop - part.start for part in parts])
    deviations: Numbers = np.repeat(DEVIATION / np.sqrt(len(parts) * sizes), sizes)
    return deviations


def initial_network(
    rng: np.random.Generator, deviations: Numbers, widths: Sequence[int]
) -> Numbers:
    """Draw a network that does nothing yet: its last layer and its biases are zero.

    Parameters
    ----------
    rng : numpy.random.Generator
        Draws the other weights, which are normal numbers.
    deviations : ndarray, shape (n_observations,)
        Standard deviations of the first layer's weights, by their input; those of the others are
        one over the root of the layer's inputs.
    widths : sequence of int
        Widths of the layers after the observation.

    Returns
    -------
    ndarray, shape (1, n_parameters)
    """
    parts = []
    for n_out in widths[:-1]:
        weights = perturbations(rng, (len(deviations), n_out)) * deviations[:, None]
        parts += [weights.ravel(), np.zeros(n_out)]
        deviations = np.full(n_out, 1 / np.sqrt(n_out))
    return np.concatenate([*parts, np.zeros((len(deviations) + 1) * widths[-1])])[None]


def perturbed_networks(
    theta: Numbers, step: Numbers, normalizer: Normalizer, widths: Sequence[int]
) -> Networks:
    """Networks theta + step of normalised observations, then those of theta - step.

    Parameters
    ----------
    theta, step : ndarray, shape (1, n_parameters) and (n, 1, n_parameters)
        Parameters, and what is added to them, and subtracted.
    normalizer, widths
        Statistics, which are folded in, and widths from the observation to the action.
    """
    parameters = np.concatenate([theta + step, theta - step])[:, 0]
    n_in, n_out = widths[:2]
    weights, bias = next(_layers(parameters, widths))
    folded = fold_normalizer(weights, bias, normalizer.mean, normalizer.std)
    rest = parameters[:, (n_in + 1) * n_out :]
    first = folded[0].transpose(0, 2, 1).reshape(len(parameters), -1)
    return Networks(np.array(widths), np.concatenate([first, folded[1], rest], axis=1))


def network_layers(theta: Numbers, widths: Sequence[int]) -> tuple[Layer, ...]:
    """Layers of the network with these parameters, shape (1, n_parameters).

    The widths are those from the observation to the action.
    """
    return tuple(Layer(weights[0], bias[0]) for weights, bias in _layers(theta, widths))


def _layers(parameters: Numbers, widths: Sequence[int]) -> Iterator[tuple[Numbers, Numbers]]:
    """Weights, shape (n, n_out, n_in), and biases, shape (n, n_out), of each layer."""
    start = 0
    for n_in, n_out in pairwise(widths):
        weights = parameters[:, start : start + n_in * n_out].reshape(-1, n_in, n_out)
        start += (n_in + 1) * n_out
        yield weights.transpose(0, 2, 1), parameters[:, start - n_out : start]


def parameters_of(policy: Policy) -> Numbers:
    """Parameters of a policy as a training has them: a linear one has no bias."""
    if len(policy.layers) > 1:
        parts = chain(*((weights.T.ravel(), bias) for weights, bias in policy.layers))
        return np.concatenate([*parts])[None]
    weights, bias = policy.layers[0]
    if bias.any():
        raise InvalidInputError("initial_policy has a bias, which linear policies of ARS have not")
    return np.array(weights)
