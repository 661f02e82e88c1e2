"""Actor and critic: in one vector, in the kernels, and as a policy."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm._parallel import run_rows
from kinarm.errors import InvalidInputError
from kinarm.policies.library import layer_widths
from kinarm.policies.mirror import problem_mirror
from kinarm.policies.policy import Layer, Policy
from kinarm.policies.ppo import PPOConfig, PPOState
from kinarm.policies.ppo.kernels.layers import BLOCK, Network, Numbers, evaluate, padded, transpose
from kinarm.policies.provenance import Provenance

STEPS_A_ROW = 8
"""Work of a network per observation, in steps of an episode."""

HIDDEN_GAIN, ACTOR_GAIN, CRITIC_GAIN = 2.0**0.5, 0.01, 1.0
"""Factors of orthogonal initial weights, as in Stable-Baselines3."""

Vector = NDArray[Any]


class Parameters(NamedTuple):
    """Parts of a vector: logarithms of the deviations, and layers."""

    log_std: Vector
    actor: list[Layer]
    critic: list[Layer]


def _shapes(widths: Sequence[int]) -> list[tuple[int, int]]:
    """Inputs and outputs of all layers, in the order of Stable-Baselines3.

    Hidden layers of actor and critic come first, then the last ones.
    """
    *hidden, last = pairwise(widths)
    return [*hidden, *hidden, last, (widths[-2], 1)]


def _count(widths: Sequence[int]) -> int:
    """Number of all parameters."""
    return widths[-1] + sum((n_in + 1) * n_out for n_in, n_out in _shapes(widths))


def split_parameters(vector: Vector, widths: Sequence[int]) -> Parameters:
    """Take a vector apart, into views of it.

    Standard deviations come first, and weights before biases.

    It holds all parameters, shape (n_parameters,); widths are those of the actor's layers, from the
    observation to the action.
    """
    shapes = _shapes(widths)
    sizes = [widths[-1], *(size for n_in, n_out in shapes for size in (n_in * n_out, n_out))]
    if len(vector) != sum(sizes):
        raise InvalidInputError(f"expected a state of {sum(sizes)} parameters, got {len(vector)}")
    log_std, *parts = np.split(vector, np.cumsum(sizes)[:-1])
    layers = [
        Layer(weights.reshape(n_out, n_in), bias)
        for (n_in, n_out), weights, bias in zip(shapes, parts[::2], parts[1::2], strict=True)
    ]
    count = len(widths) - 2
    return Parameters(log_std, [*layers[:count], layers[-2]], [*layers[count:-2], layers[-1]])


def initial_parameters(
    rng: np.random.Generator, widths: Sequence[int], log_std: float
) -> NDArray[np.float32]:
    """Draw orthogonal weights and zero biases, as Stable-Baselines3 does.

    Parameters
    ----------
    rng : numpy.random.Generator
        Draws the weights.
    widths
        As for `split_parameters`.
    log_std : float
        Logarithm of the standard deviation of the actions.
    """
    vector = np.zeros(_count(widths))
    parts = split_parameters(vector, widths)
    parts.log_std[:] = log_std
    for layers, gain in ((parts.actor, ACTOR_GAIN), (parts.critic, CRITIC_GAIN)):
        for weights, _ in layers:
            weights[:] = HIDDEN_GAIN * orthogonal(rng.standard_normal(weights.shape))
        layers[-1][0][:] *= gain / HIDDEN_GAIN
    return vector.astype(np.float32)


def orthogonal(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Make columns, or rows if there are fewer, of a matrix orthonormal.

    Of normal numbers it makes any rotation equally likely. Sums have a fixed order, unlike those of
    BLAS.
    """
    tall = normal.shape[0] >= normal.shape[1]
    found = (normal.T if tall else normal).copy()
    for k, row in enumerate(found):  # Gram and Schmidt
        for _ in range(2):  # once more, against rounding
            along = (found[:k] * row).sum(axis=1)
            row -= (along[:, None] * found[:k]).sum(axis=0)
        row /= np.sqrt((row * row).sum())
    return found.T if tall else found


class ActorCritic:
    """Actor and critic, whose parameters lie in one array; for widths, see `split_parameters`.

    Attributes
    ----------
    weights : ndarray of float32, shape (n_weights,)
        Matrices (inputs x outputs) and biases, their rows padded with zeros,
        and the logarithms of the standard deviations.
    actor, critic : Network
        The networks.
    log_std : ndarray of float32, shape (n_actions,)
        Logarithms of the standard deviations of the actions.
    """

    def __init__(self, widths: Sequence[int]) -> None:
        self.n_parameters, n_actions = _count(widths), widths[-1]
        numbers = split_parameters(np.arange(self.n_parameters), widths)
        self._places = np.zeros(self.n_parameters, dtype=np.int64)
        tables, end, turned = [], 0, 0
        for layers in (numbers.actor, numbers.critic):
            table, end, turned = self._place(layers, end, turned)
            tables.append(table)
        self._places[numbers.log_std] = end + np.arange(n_actions)
        self.weights = np.zeros(end + padded(n_actions), dtype=np.float32)
        self.log_std = self.weights[end : end + n_actions]
        matrices = np.zeros(turned, dtype=np.float32)
        *inputs, outputs = map(padded, widths)
        given = (self.weights, matrices, BLOCK * (sum(inputs) + outputs), max(inputs))
        self.actor, self.critic = (Network(table, *given) for table in tables)

    def _place(
        self, layers: list[Layer], first: int, turned: int
    ) -> tuple[NDArray[np.int64], int, int]:
        """Lay out a network behind earlier ones; returns new ends of the arrays."""
        rows, inputs = [], 0
        for weights, bias in layers:
            n_out, n_in = weights.shape
            wide_in, wide_out = padded(n_in), padded(n_out)
            outputs = inputs + BLOCK * wide_in
            rows.append((n_in, n_out, first, turned, inputs, outputs))
            entries = first + np.arange(n_in) * wide_out + np.arange(n_out)[:, None]
            self._places[weights] = entries
            self._places[bias] = first + wide_in * wide_out + np.arange(n_out)
            first += (wide_in + 1) * wide_out
            turned, inputs = turned + n_out * wide_in, outputs
        return np.array(rows), first, turned

    def scattered(self, vector: Numbers) -> Numbers:
        """Lay out a vector like the weights."""
        padded_vector = np.zeros_like(self.weights)
        padded_vector[self._places] = vector
        return padded_vector

    def gathered(self, weights: Numbers) -> Numbers:
        """Undo `scattered`."""
        return weights[self._places]

    def load(self, vector: Numbers) -> None:
        """Take over parameters in the order of Stable-Baselines3."""
        self.weights[self._places] = vector
        transpose(self.actor)
        transpose(self.critic)

    def means(self, observations: Numbers) -> Numbers:
        """Actions of the actor before noise, shape (n, n_actions)."""
        outputs = np.empty((len(observations), len(self.log_std)), dtype=np.float32)
        evaluate(0, len(observations), self.actor, observations, outputs)
        return outputs

    def values(self, observations: Numbers, threads: int) -> Numbers:
        """Values of the critic, shape (n,)."""
        outputs = np.empty((len(observations), 1), dtype=np.float32)
        arrays = (self.critic, observations, outputs)
        run_rows(evaluate, len(observations), STEPS_A_ROW * len(observations), threads, *arrays)
        return outputs[:, 0]


def actor_policy(config: PPOConfig, state: PPOState) -> Policy:
    """Freeze the actor of a state into a policy of mean actions."""
    parameters = state.parameters.astype(np.float64)
    actor = split_parameters(parameters, layer_widths(config.problem, config.net_arch)).actor
    return Policy(
        mean=state.normalizer.mean,
        std=state.normalizer.std,
        layers=tuple(actor),
        provenance=Provenance.of("ppo", config, state.environment_steps),
        mirror=problem_mirror(config.problem) if config.symmetric else None,
        residual=config.residual,
    )
