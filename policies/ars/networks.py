"""Small networks with tanh as policies of Augmented Random Search.

Parameters are in one row, in the order of `kinarm.networks.split_parameters`.
"""

import math
from collections.abc import Sequence

import numpy as np

from kinarm.errors import InvalidInputError
from kinarm.kernels.compiling import Array, inlined, kernel
from kinarm.kernels.elementary import LOG_2, LOG_2_REST, TURN, sine_cosine
from kinarm.kernels.lanes import LANES, as_lanes, power_of_two, select
from kinarm.networks import Layer, Networks, split_parameters
from kinarm.observation_layout import ObservationLayout
from kinarm.policies.normalizer import Normalizer, fold_normalizer
from kinarm.policies.policy import Policy

DEVIATION = 1.5
"""Standard deviation of units of the first layer, for normalised inputs."""


def perturbations(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Draw standard normal numbers, the same bits on every machine.

    NumPy's depend on the C library's logarithm.
    """
    count = math.prod(shape)
    half = -(-count // 2)
    numbers = np.zeros((2, -(-half // LANES) * LANES))
    numbers[:, :half] = rng.random((2, half))
    normal_pairs(numbers.reshape(2, -1, LANES))
    return numbers[:, :half].reshape(-1)[:count].reshape(shape)


def initial_network(
    rng: np.random.Generator, layout: ObservationLayout, widths: Sequence[int]
) -> Array:
    """Draw a network whose last layer and biases are zero.

    In the first layer, all parts of the observation count alike, or the few entries of the goal
    would drown. In others, the standard deviation is one over the root of the inputs.

    Parameters
    ----------
    rng : numpy.random.Generator
        Draws the other weights, normal numbers.
    layout : ObservationLayout
        The parts of the observation.
    widths : sequence of int
        Widths of the layers after the observation.

    Returns
    -------
    ndarray, shape (1, n_parameters)
    """
    sizes = np.array([layout.length(part) for part in layout.parts] * layout.history)
    deviations, parts = np.repeat(DEVIATION / np.sqrt(len(sizes) * sizes), sizes), []
    for n_out in widths[:-1]:
        weights = perturbations(rng, (len(deviations), n_out)) * deviations[:, None]
        parts += [weights.ravel(), np.zeros(n_out)]
        deviations = np.full(n_out, 1 / np.sqrt(n_out))
    return np.concatenate([*parts, np.zeros((len(deviations) + 1) * widths[-1])])[None]


def perturbed_networks(
    theta: Array, step: Array, normalizer: Normalizer, widths: Sequence[int]
) -> Networks:
    """Networks theta + step of normalised inputs, then those of theta - step.

    Parameters
    ----------
    theta, step : ndarray, shape (1, n_parameters) and (n, 1, n_parameters)
        Parameters, and what is added to them, and subtracted.
    normalizer, widths
        Statistics, folded in, and widths from observation to action.
    """
    parameters = np.concatenate([theta + step, theta - step])[:, 0]
    first, *rest = split_parameters(parameters, widths)
    folded = fold_normalizer(*first, normalizer.mean, normalizer.std)
    return Networks((Layer(*folded), *rest))


def parameters_of(policy: Policy) -> Array:
    """Parameters of a policy for a training; linear ones have no bias."""
    if len(policy.layers) > 1:
        batches = tuple(Layer(weights[None], bias[None]) for weights, bias in policy.layers)
        return Networks(batches).parameters
    weights, bias = policy.layers[0]
    if bias.any():
        raise InvalidInputError("initial_policy has a bias, which linear policies of ARS have not")
    return np.array(weights)


@inlined
def logarithm(x: float) -> float:
    """Natural logarithm of a number between 2^-63 and 1, with relative error 3e-16.

    The polynomial is that of FreeBSD's libm.
    """
    halvings = 0.0 * x
    for doublings in (32.0, 16.0, 8.0, 4.0, 2.0, 1.0):
        small = x < power_of_two(-doublings)
        x = select(small, x * power_of_two(doublings), x)
        halvings = select(small, halvings + doublings, halvings)
    small = x < 0.7071067811865476
    x = select(small, 2.0 * x, x)
    halvings = select(small, halvings + 1.0, halvings)
    f = x - 1.0
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    even = w * (
        3.999999999940941908e-1 + w * (2.222219843214978396e-1 + w * 1.531383769920937332e-1)
    )
    odd = 2.857142874366239149e-1 + w * (1.818357216161805012e-1 + w * 1.479819860511658591e-1)
    half = 0.5 * f * f
    rest = s * (half + even + z * (6.666666666666735130e-1 + w * odd))
    return f - (half - (rest - halvings * LOG_2_REST)) - halvings * LOG_2


@kernel
def normal_pairs(numbers: Array) -> None:
    """Make normal numbers of uniform ones in [0, 1), in place (Box and Muller).

    The array has the shape (2, n, LANES); numbers of both halves make independent pairs.
    """
    pairs = as_lanes(numbers)
    for i in range(pairs.shape[1]):
        radius = math.sqrt(-2.0 * logarithm(1.0 - pairs[0, i]))
        sine, cosine = sine_cosine(TURN * pairs[1, i])
        pairs[0, i] = radius * cosine
        pairs[1, i] = radius * sine
