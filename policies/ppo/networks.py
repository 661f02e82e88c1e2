"""Actor and critic in the compiled kernels."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kinarm._parallel import run_rows
from kinarm.policies.ppo.kernels.layers import BLOCK, Network, padded
from kinarm.policies.ppo.kernels.tiles import Numbers
from kinarm.policies.ppo.kernels.update import evaluate, transpose
from kinarm.policies.ppo.parameters import Affine, split_parameters

STEPS_A_ROW = 8
"""Work of passing an observation through a network, in steps of an episode."""


class ActorCritic:
    """The networks of actor and critic, whose parameters lie in one array.

    Parameters
    ----------
    n_observations, n_actions : int
        Widths of the input and of the actor's output.
    net_arch : sequence of int
        Widths of the hidden layers of both.
    n_parameters : int
        How many parameters they have.

    Attributes
    ----------
    weights : ndarray of float32, shape (n_weights,)
        The parameters: matrices (inputs x outputs) and biases, their rows padded with zeros, and
        the logarithms of the standard deviations.
    actor, critic : Network
        The networks.
    log_std : ndarray of float32, shape (n_actions,)
        Logarithms of the standard deviations of the actions.
    """

    def __init__(
        self, n_observations: int, net_arch: Sequence[int], n_actions: int, n_parameters: int
    ) -> None:
        numbers = split_parameters(np.arange(n_parameters), n_observations, net_arch, n_actions)
        self._places = np.zeros(n_parameters, dtype=np.int64)
        tables, end, turned = [], 0, 0
        for layers in (numbers.actor, numbers.critic):
            table, end, turned = self._place(layers, end, turned)
            tables.append(table)
        self._places[numbers.log_std] = end + np.arange(n_actions)
        self.weights = np.zeros(end + padded(n_actions), dtype=np.float32)
        self.log_std = self.weights[end : end + n_actions]
        matrices = np.zeros(turned, dtype=np.float32)
        self.actor, self.critic = (Network(table, self.weights, matrices) for table in tables)

    def _place(
        self, layers: list[Affine], first: int, turned: int
    ) -> tuple[NDArray[np.int64], int, int]:
        """Lay out a network behind what lies in the arrays already; returns their new ends."""
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

    def spread(self, vector: Numbers) -> Numbers:
        """Lay out a vector like the weights."""
        padded_vector = np.zeros_like(self.weights)
        padded_vector[self._places] = vector
        return padded_vector

    def gathered(self, weights: Numbers) -> Numbers:
        """Undo `spread`."""
        return weights[self._places]

    def load(self, vector: Numbers) -> None:
        """Take over parameters in the order of Stable-Baselines3."""
        self.weights[self._places] = vector
        transpose(self.actor)
        transpose(self.critic)

    def means(self, observations: Numbers) -> Numbers:
        """What the actor makes of observations, shape (n, n_actions)."""
        outputs = np.empty((len(observations), len(self.log_std)), dtype=np.float32)
        evaluate(0, len(observations), self.actor, observations, outputs)
        return outputs

    def values(self, observations: Numbers, threads: int) -> Numbers:
        """What the critic makes of observations, shape (n,)."""
        outputs = np.empty((len(observations), 1), dtype=np.float32)
        arrays = (self.critic, observations, outputs)
        run_rows(evaluate, len(observations), STEPS_A_ROW * len(observations), threads, *arrays)
        return outputs[:, 0]
