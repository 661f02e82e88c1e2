"""Batches of dense networks in the form in which the compiled simulator runs them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, Union, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from kinarm.errors import InvalidInputError


@runtime_checkable
class CompiledPolicy(Protocol):
    """A policy that can run inside the compiled simulator."""

    def networks(self) -> "Networks":
        """The policy as a batch of one network, its normaliser included."""


@dataclass(frozen=True, eq=False)
class Networks:
    """Networks of equal layer widths: tanh between layers, output clipped to [-1, 1].

    Attributes
    ----------
    layers : ndarray of int, shape (n_layers + 1,)
        Widths, from the observation to the action.
    weights : ndarray, shape (n_networks, n_parameters)
        Per network, layer after layer: weights (inputs x outputs, row by row), then the bias.
    """

    layers: NDArray[np.int64]
    weights: NDArray[np.float64]

    @classmethod
    def linear(cls, matrices: NDArray[np.float64], biases: NDArray[np.float64]) -> "Networks":
        """Linear policies.

        Parameters
        ----------
        matrices : ndarray, shape (n, n_actions, n_observations)
            Maps from observations to actions.
        biases : ndarray, shape (n, n_actions)
            Constant parts of the actions.
        """
        n, n_out, n_in = matrices.shape
        flat = matrices.transpose(0, 2, 1).reshape(n, -1)
        return cls(np.array([n_in, n_out]), np.concatenate([flat, biases], axis=1))

    @classmethod
    def collect(
        cls, policies: Union["Networks", CompiledPolicy, Sequence[CompiledPolicy]]
    ) -> "Networks":
        """Gather policies into one batch.

        Raises
        ------
        InvalidInputError
            If there is none, or their layers differ.
        """
        if isinstance(policies, Networks):
            return policies
        if isinstance(policies, CompiledPolicy):
            return policies.networks()
        batch = [policy.networks() for policy in policies]
        if not batch:
            raise InvalidInputError("no policy was given")
        shapes = {tuple(networks.layers.tolist()) for networks in batch}
        if len(shapes) > 1:
            raise InvalidInputError(f"policies of one rollout must share layers, got {shapes}")
        return cls(batch[0].layers, np.concatenate([networks.weights for networks in batch]))
