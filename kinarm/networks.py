"""Sources of actions for the compiled simulator: batches of dense networks, and tables."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, Union, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm.episodes import Control
from kinarm.errors import InvalidInputError
from kinarm.validation import finite_array


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

    Raises
    ------
    InvalidInputError
        If the number of parameters does not fit the widths, or one is not finite.
    """

    layers: NDArray[np.int64]
    weights: NDArray[np.float64]

    def __post_init__(self) -> None:
        widths = np.asarray(self.layers)
        if widths.ndim != 1 or len(widths) < 2 or (widths < 1).any():
            raise InvalidInputError(f"layers must hold at least two widths, got {self.layers}")
        n_parameters = int(((widths[:-1] + 1) * widths[1:]).sum())
        object.__setattr__(self, "layers", widths.astype(np.int64))
        weights = finite_array("weights", self.weights, (None, n_parameters))
        object.__setattr__(self, "weights", weights)

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
            If there is none, one cannot run compiled, or their layers differ.
        """
        if isinstance(policies, Networks):
            return policies
        if isinstance(policies, CompiledPolicy):
            return policies.networks()
        if not policies or not all(isinstance(policy, CompiledPolicy) for policy in policies):
            raise InvalidInputError(
                "expected Networks, a policy that offers networks(), a sequence of such policies "
                f"or a function, got {policies!r}"
            )
        batch = [policy.networks() for policy in policies]
        shapes = {tuple(networks.layers.tolist()) for networks in batch}
        if len(shapes) > 1:
            raise InvalidInputError(f"policies of one rollout must share layers, got {shapes}")
        return cls(batch[0].layers, np.concatenate([networks.weights for networks in batch]))


def network_control(
    policies: Networks | CompiledPolicy | Sequence[CompiledPolicy],
    policy_index: ArrayLike | None,
    n: int,
    widths: tuple[int, int],
) -> Control:
    """Arrange networks for the kernels.

    Parameters
    ----------
    policies : Networks, policy or sequence of policies
        One for all episodes, or one for each, or as many as `policy_index` refers to.
    policy_index : array_like of int, shape (n,), optional
        Which network drives which episode.
    n : int
        Number of episodes.
    widths : tuple of int
        Length of an observation and of an action.

    Raises
    ------
    InvalidInputError
        If the networks do not fit the widths, or the index does not fit the networks.
    """
    networks = Networks.collect(policies)
    given = (int(networks.layers[0]), int(networks.layers[-1]))
    if given != widths:
        raise InvalidInputError(
            f"the policy maps {given[0]} observations to {given[1]} actions; the arm has "
            f"{widths[0]} and {widths[1]}"
        )
    count = len(networks.weights)
    if policy_index is None:
        if count not in (1, n):
            raise InvalidInputError(f"{count} policies for {n} episodes: give policy_index")
        index = np.arange(n) if count == n else np.zeros(n, dtype=np.int64)
    else:
        index = np.array(policy_index)
        whole = index.shape == (n,) and np.issubdtype(index.dtype, np.integer)
        if not whole or (n and not 0 <= index.min() <= index.max() < count):
            raise InvalidInputError(f"policy_index must hold {n} whole numbers in 0..{count - 1}")
    no_table = np.zeros((0, 0, 0))
    return Control(networks.layers, networks.weights, index.astype(np.int64), no_table)


def table_control(actions: NDArray[np.float64]) -> Control:
    """Take actions from a table, shape (n, n_steps, n_actions); one step serves every step."""
    nothing = np.zeros(0, dtype=np.int64)
    return Control(nothing, np.zeros((0, 0)), nothing, actions)
