"""Dense networks for the compiled simulator."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, pairwise
from typing import Any, Literal, NamedTuple, Protocol, get_args, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from kinarm.episodes import Control
from kinarm.errors import InvalidInputError, check_known, finite_array, whole_number
from kinarm.kernels.compiling import Array


@runtime_checkable
class CompiledPolicy(Protocol):
    """A policy that can run inside the compiled simulator."""

    def networks(self) -> Networks:
        """The policy and its normaliser as a batch of one network."""


Activation = Literal["linear", "tanh", "relu", "hardtanh", "elu", "leaky_relu", "silu"]
"""Functions after layers, in the order of `kinarm.episodes`."""


class Layer(NamedTuple):
    """An affine map: ``weights @ x + bias``, or a batch of them.

    Attributes
    ----------
    weights : ndarray, shape ([n,] n_out, n_in)
        In the order of PyTorch's ``Linear``.
    bias : ndarray, shape ([n,] n_out)
    """

    weights: Array
    bias: Array


class Mirror(NamedTuple):
    """Signs in the reflection y -> -y, and where the goal's y is.

    Attributes
    ----------
    observations, actions, goals : ndarray
        Signs of their entries.
    side : int
        Entry of the observation that is positive for goals on the left.
    """

    observations: Array
    actions: Array
    side: int = 1
    goals: Array = np.array([1.0, -1.0, 1.0])

    def scenarios_from_the_right(self, starts: Array, goals: Array) -> tuple[Array, Array]:
        """Reflect starts, shape (n, n_joints), and goals, shape (n, goal_width), on the left.

        Joints that are not actuated stay.
        """
        left = goals[:, 1] > 0
        starts, goals = starts.copy(), goals.copy()
        starts[left, : len(self.actions)] *= self.actions
        goals[left] *= self.goals
        return starts, goals


@dataclass(frozen=True, eq=False)
class Networks:
    """Dense networks of equal widths, with outputs clipped to [-1, 1].

    Attributes
    ----------
    layers : tuple of Layer
        From the observation to the action, each of all networks: weights of
        shape (n_networks, n_out, n_in), and biases (n_networks, n_out).
    activations : tuple of str
        Function after each layer, the last one before the clip: ``"linear"``,
        ``"tanh"``, ``"relu"``, ``"hardtanh"``, ``"elu"``, ``"leaky_relu"`` or
        ``"silu"``; by default tanh between layers, none after the last.
    mirror : Mirror or None
        Reflection of goals on the left, and of actions; None for no reflection.
    rates : int
        First entry of ``resolved_rate``, to which outputs are added; -1 for none.
    """

    layers: tuple[Layer, ...]
    activations: tuple[Activation, ...] = ()
    mirror: Mirror | None = None
    rates: int = -1

    def __post_init__(self) -> None:
        if not self.layers:
            raise InvalidInputError("networks need at least one layer")
        layers: list[Layer] = []
        count = width = None
        for number, (weights, bias) in enumerate(self.layers):
            # Widths that are not known yet may be any.
            checked = finite_array(f"weights of layer {number}", weights, (count, None, width))
            count, width = checked.shape[:2]
            layers.append(
                Layer(checked, finite_array(f"bias of layer {number}", bias, (count, width)))
            )
        activations = checked_activations(self.activations, len(layers))
        (n_observations, *_), n_actions = layers[0].weights.shape[2:], width
        if not -1 <= self.rates <= n_observations - n_actions:
            raise InvalidInputError(f"rates must be the first of {n_actions} observations")
        if (mirror := self.mirror) is not None:
            seen = finite_array("mirror of observations", mirror.observations, (n_observations,))
            actions = finite_array("mirror of actions", mirror.actions, (n_actions,))
            whole_number("side of the mirror", mirror.side, 0, n_observations - 1)
            mirror = mirror._replace(observations=seen, actions=actions)
            object.__setattr__(self, "mirror", mirror)
        object.__setattr__(self, "layers", tuple(layers))
        object.__setattr__(self, "activations", activations)

    def __len__(self) -> int:
        """Number of networks."""
        return len(self.layers[0].bias)

    def __repr__(self) -> str:
        return f"Networks({len(self)} of layers {'-'.join(map(str, self.widths))})"

    @property
    def widths(self) -> tuple[int, ...]:
        """Widths from the observation to the action."""
        return (self.layers[0].weights.shape[2], *(layer.bias.shape[1] for layer in self.layers))

    @cached_property
    def parameters(self) -> Array:
        """What kernels read, shape (n_networks, n_parameters); see ``split_parameters``."""
        n = len(self)
        parts = ((weights.transpose(0, 2, 1).reshape(n, -1), bias) for weights, bias in self.layers)
        return np.concatenate([*chain(*parts)], axis=1)

    @classmethod
    def of(cls, policies: Networks | CompiledPolicy) -> Networks:
        """The networks themselves, or those of a policy."""
        if isinstance(policies, Networks):
            return policies
        if isinstance(policies, CompiledPolicy):
            return policies.networks()
        raise InvalidInputError(
            f"expected Networks, a policy that offers networks() or a function, got {policies!r}"
        )


def split_parameters(parameters: Array, widths: Sequence[int]) -> Iterator[Layer]:
    """Views of the layers of networks, whose parameters kernels read in this order.

    Each layer's weights come input by input, then its bias. The parameters have the shape
    (n_networks, n_parameters); widths go from the observation to the action.
    """
    start = 0
    for n_in, n_out in pairwise(widths):
        weights = parameters[:, start : start + n_in * n_out].reshape(-1, n_in, n_out)
        start += (n_in + 1) * n_out
        yield Layer(weights.transpose(0, 2, 1), parameters[:, start - n_out : start])


PolicyFunction = Callable[..., ArrayLike]
"""Observations, shape (n, n_observations), to actions, shape (n, n_actuated)."""


def takes_rows(policy: Callable[..., Any]) -> bool:
    """Whether a function of observations also asks for the numbers of their episodes."""
    try:
        return "rows" in inspect.signature(policy).parameters
    except (TypeError, ValueError):  # of functions without a signature
        return False


def network_control(
    policies: Networks | CompiledPolicy,
    policy_index: ArrayLike | None,
    n: int,
    widths: tuple[int, int],
) -> Control:
    """Arrange the networks of n episodes for the kernels.

    Parameters
    ----------
    policies : Networks or policy
        One network for all episodes, one for each, or those of ``policy_index``.
    policy_index : array_like of int, shape (n,), or None
        Policy of each episode.
    n, widths
        Number of episodes, and lengths of observation and action.
    """
    networks = Networks.of(policies)
    given = (networks.widths[0], networks.widths[-1])
    if given != widths:
        raise InvalidInputError(
            f"the policy maps {given[0]} observations to {given[1]} actions; the arm has "
            f"{widths[0]} and {widths[1]}"
        )
    count = len(networks)
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
        layers=np.array(networks.widths),
        weights=networks.parameters,
        policy=index.astype(np.int64),
        activations=np.array([get_args(Activation).index(name) for name in networks.activations]),
        rates=networks.rates,
    )
    if networks.mirror is None:
        return control
    # Copies are writable: kernels are compiled anew for read-only arrays.
    signs, action_signs = map(np.array, networks.mirror[:2])
    side = networks.mirror.side
    return control._replace(observation_signs=signs, action_signs=action_signs, side=side)


def checked_activations(given: Sequence[Activation], n_layers: int) -> tuple[Activation, ...]:
    """Functions after some layers: as given, or the usual ones."""
    check_known("activation function", map(str, given), get_args(Activation))
    if not given:
        between: tuple[Activation, ...] = ("tanh",)
        return (*between * (n_layers - 1), "linear")
    if len(given) != n_layers:
        raise InvalidInputError(
            f"expected an activation function for each of {n_layers} layers, got {len(given)}"
        )
    return tuple(given)
