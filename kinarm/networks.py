"""Dense networks for the compiled simulator."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal, NamedTuple, Protocol, get_args, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm.episodes import Control
from kinarm.errors import InvalidInputError, UnknownNameError, finite_array
from kinarm.kernels.compiling import Array
from kinarm.kernels.network import LEAK
from kinarm.observation import GOAL_SIDE


@runtime_checkable
class CompiledPolicy(Protocol):
    """A policy that can run inside the compiled simulator."""

    def networks(self) -> Networks:
        """The policy and its normaliser as a batch of one network."""


ACTIVATIONS: dict[str, Callable[[Array], Array]] = {
    "linear": lambda values: values,
    "tanh": np.tanh,
    "relu": lambda values: np.maximum(values, 0.0),
    "hardtanh": lambda values: np.clip(values, -1.0, 1.0),
    "elu": lambda values: np.where(values < 0, np.expm1(np.minimum(values, 0.0)), values),
    "leaky_relu": lambda values: np.where(values < 0, LEAK * values, values),
    "silu": lambda values: values * (0.5 + 0.5 * np.tanh(0.5 * values)),
}
"""Activation functions by name, in the order of `kinarm.episodes`."""

Activation = Literal["linear", "tanh", "relu", "hardtanh", "elu", "leaky_relu", "silu"]


class Layer(NamedTuple):
    """An affine map: ``weights @ x + bias``.

    Attributes
    ----------
    weights : ndarray, shape (n_out, n_in)
    bias : ndarray, shape (n_out,)
    """

    weights: Array
    bias: Array


class Mirror(NamedTuple):
    """Signs of observations and actions in the reflection y -> -y."""

    observations: Array
    actions: Array

    def on_the_left(self, observations: Array) -> NDArray[np.bool_]:
        """Which observations, shape (n, n_observations), have a goal on the left."""
        return observations[:, GOAL_SIDE] > 0

    def from_the_right(self, observations: Array) -> Array:
        """Reflect observations, shape (n, n_observations), of goals on the left."""
        left = self.on_the_left(observations)
        return np.where(left[:, None], observations * self.observations, observations)

    def scenarios_from_the_right(self, starts: Array, goals: Array) -> tuple[Array, Array]:
        """Reflect starts, shape (n, n_joints), and goals, shape (n, 3), on the left.

        Joints that are not actuated stay.
        """
        left = goals[:, 1] > 0
        starts, goals = starts.copy(), goals.copy()
        starts[left, : len(self.actions)] *= self.actions
        goals[left, 1] *= -1.0
        return starts, goals


@dataclass(frozen=True, eq=False)
class Networks:
    """Dense networks of equal widths, with outputs clipped to [-1, 1].

    Attributes
    ----------
    layers : ndarray of int, shape (n_layers + 1,)
        Widths, from the observation to the action.
    weights : ndarray, shape (n_networks, n_parameters)
        Per network and layer, weights (inputs x outputs, row by row), then the
        bias.
    activations : tuple of str
        Function after each layer, the last one before the clip: ``"linear"``,
        ``"tanh"``, ``"relu"``, ``"hardtanh"``, ``"elu"``, ``"leaky_relu"`` or
        ``"silu"``; by default tanh between layers, none after the last.
    mirror : Mirror or None
        Reflection of goals on the left, and of actions; None for no reflection.
    """

    layers: NDArray[np.int64]
    weights: Array
    activations: tuple[Activation, ...] = ()
    mirror: Mirror | None = None

    def __post_init__(self) -> None:
        widths = np.asarray(self.layers)
        if widths.ndim != 1 or len(widths) < 2 or (widths < 1).any():
            raise InvalidInputError(f"layers must hold at least two widths, got {self.layers}")
        object.__setattr__(self, "layers", widths.astype(np.int64))
        n_parameters = sum((n_in + 1) * n_out for n_in, n_out in pairwise(self.layers.tolist()))
        weights = finite_array("weights", self.weights, (None, n_parameters))
        object.__setattr__(self, "weights", weights)
        activations = checked_activations(self.activations, len(widths) - 1)
        object.__setattr__(self, "activations", activations)

    def __repr__(self) -> str:
        widths = "-".join(map(str, self.layers.tolist()))
        return f"Networks({len(self.weights)} of layers {widths})"

    @classmethod
    def linear(cls, matrices: Array, biases: Array) -> Networks:
        """Linear policies: maps, shape (n, n_actions, n_observations), and biases."""
        n, n_out, n_in = matrices.shape
        flat = matrices.transpose(0, 2, 1).reshape(n, -1)
        return cls(np.array([n_in, n_out]), np.concatenate([flat, biases], axis=1))

    @classmethod
    def collect(cls, policies: Networks | CompiledPolicy | Sequence[CompiledPolicy]) -> Networks:
        """Gather policies of the same layers, functions and mirror."""
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
        first = batch[0]
        for other in batch[1:]:
            if first.form != other.form:
                raise InvalidInputError(
                    "policies of one rollout must share layers, functions and mirror, got "
                    f"{first.form[0]} and {other.form[0]}"
                )
        return replace(first, weights=np.concatenate([networks.weights for networks in batch]))

    @property
    def form(self) -> tuple[object, ...]:
        """All but the weights, to compare."""
        signs = () if self.mirror is None else (tuple(part.tolist()) for part in self.mirror)
        return tuple(self.layers.tolist()), self.activations, tuple(signs)


def network_control(
    policies: Networks | CompiledPolicy | Sequence[CompiledPolicy],
    policy_index: ArrayLike | None,
    n: int,
    widths: tuple[int, int],
) -> Control:
    """Arrange the networks of n episodes for the kernels.

    Parameters
    ----------
    policies : Networks, policy or sequence of policies
        One for all episodes, one for each, or those of ``policy_index``.
    policy_index : array_like of int, shape (n,), or None
        Policy of each episode.
    n, widths
        Number of episodes, and lengths of observation and action.
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
        index = np.asarray(policy_index)
        whole = index.shape == (n,) and index.dtype.kind in "iu"
        if not whole or (n and not 0 <= index.min() <= index.max() < count):
            raise InvalidInputError(f"policy_index must hold {n} whole numbers in 0..{count - 1}")
    control = Control(
        layers=networks.layers,
        weights=networks.weights,
        policy=index.astype(np.int64),
        activations=np.array([[*ACTIVATIONS].index(name) for name in networks.activations]),
    )
    if networks.mirror is None:
        return control
    # Copies are writable: kernels are compiled anew for read-only arrays.
    signs, action_signs = map(np.array, networks.mirror)
    return control._replace(observation_signs=signs, action_signs=action_signs)


def checked_activations(given: Sequence[Activation], n_layers: int) -> tuple[Activation, ...]:
    """Functions after some layers: as given, or the usual ones."""
    for name in given:
        if name not in ACTIVATIONS:
            raise UnknownNameError("activation function", str(name), get_args(Activation))
    if not given:
        between: tuple[Activation, ...] = ("tanh",)
        return (*between * (n_layers - 1), "linear")
    if len(given) != n_layers:
        raise InvalidInputError(
            f"expected an activation function for each of {n_layers} layers, got {len(given)}"
        )
    return tuple(given)
