"""Networks of PyTorch as layers of a policy.

Affine maps, clips and activation functions, one after the other, are joined into layers, each with
a function after it.
"""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm.errors import InvalidInputError, MissingExtraError
from kinarm.networks import Activation
from kinarm.observation import observation_size
from kinarm.policies.policy import Layer, Policy
from kinarm.policies.provenance import Provenance, package_versions
from kinarm.problem import ReachProblem

CONVERTED = (
    "Sequential, Linear, Tanh, ReLU, ELU (alpha 1), LeakyReLU (slope 0.01), SiLU, Hardtanh, "
    "Flatten, Identity, and Dropout after eval()"
)
"""Modules that can be converted, for messages."""


class Clip(NamedTuple):
    """Limits of values: numbers, or one for each value; all are finite.

    Attributes
    ----------
    low, high : ndarray, shape () or (n,)
    """

    low: NDArray[np.float64]
    high: NDArray[np.float64]


Piece = Layer | Clip | Activation


class Chain(NamedTuple):
    """What `Policy` takes of a network.

    Attributes
    ----------
    layers : tuple of Layer
        From the observation to the action.
    activations : tuple of str
        Function after each layer.
    """

    layers: tuple[Layer, ...]
    activations: tuple[Activation, ...]


def chained(pieces: Iterable[Piece], n_inputs: int) -> Chain:
    """Join pieces into layers, each with a function after it.

    Affine maps in a row become one. A clip to other limits than -1 and 1 is that function between
    two scalings, which join their neighbours.

    Raises
    ------
    InvalidInputError
        If a map takes another number of inputs than there are.
    """
    layers: list[Layer] = []
    activations: list[Activation] = []
    open_map, width = identity(n_inputs), n_inputs
    for piece in pieces:
        if isinstance(piece, Layer):
            open_map = composed(piece, open_map)
            width = len(open_map.bias)
        elif isinstance(piece, Clip):
            middle, half = (np.broadcast_to(part, width) for part in _middle_and_half(piece))
            layers.append(Layer(open_map.weights / half[:, None], (open_map.bias - middle) / half))
            activations.append("hardtanh")
            open_map = Layer(np.diag(half), middle)
        else:
            layers.append(open_map)
            activations.append(piece)
            open_map = identity(width)
    if not layers or not _is_identity(open_map):
        layers.append(open_map)
        activations.append("linear")
    return Chain(tuple(layers), tuple(activations))


def identity(width: int) -> Layer:
    """The map that changes nothing."""
    return Layer(np.eye(width), np.zeros(width))


def composed(outer: Layer, inner: Layer) -> Layer:
    """One map for two, the inner one first.

    Raises
    ------
    InvalidInputError
        If the outer map takes another number of inputs than the inner one gives.
    """
    wanted, given = outer.weights.shape[1], len(inner.bias)
    if wanted != given:
        raise InvalidInputError(f"a layer takes {wanted} inputs where {given} arrive")
    if _is_identity(inner):
        return outer
    return Layer(outer.weights @ inner.weights, outer.weights @ inner.bias + outer.bias)


def _is_identity(layer: Layer) -> bool:
    """Whether a map changes nothing."""
    n_out, n_in = layer.weights.shape
    return n_out == n_in and not layer.bias.any() and bool((layer.weights == np.eye(n_in)).all())


def _middle_and_half(clip: Clip) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Middle and half width of what a clip lets pass."""
    return (clip.high + clip.low) / 2, (clip.high - clip.low) / 2


def policy_from_torch(
    module: Any,
    problem: ReachProblem,
    statistics: tuple[ArrayLike | None, ArrayLike | None],
    **origin: Any,
) -> Policy:
    """Convert a module; see `Policy.from_torch`. The origin is that of `Provenance`."""
    arm = problem.load_arm()
    n_observations, n_actions = observation_size(arm.n_joints), arm.n_actuated
    layers, activations = chained(module_pieces(module), n_observations)
    if len(layers[-1].bias) != n_actions:
        raise InvalidInputError(
            f"the module gives {len(layers[-1].bias)} numbers; arm {arm.name!r} takes {n_actions}"
        )
    mean, std = statistics
    return Policy(
        mean=np.zeros(n_observations) if mean is None else np.asarray(mean),
        std=np.ones(n_observations) if std is None else np.asarray(std),
        layers=layers,
        activations=activations,
        provenance=Provenance(
            recipe="torch", problem=problem.pinned, versions=package_versions(), **origin
        ),
    )


def module_pieces(module: Any) -> Iterator[Piece]:
    """What a module does, step by step; parameters become float64, which is exact.

    Raises
    ------
    InvalidInputError
        If it is, or holds, a module that cannot be converted.
    MissingExtraError
        If PyTorch is not installed.
    """
    try:
        from torch import nn
    except ImportError as error:
        raise MissingExtraError("torch", "ppo") from error
    functions: dict[type, Any] = {nn.Tanh: "tanh", nn.ReLU: "relu", nn.SiLU: "silu"}
    kind = type(module)
    if kind is nn.Sequential:
        for part in module:
            yield from module_pieces(part)
    elif kind is nn.Linear:
        yield linear_layer(module)
    elif kind in functions:
        yield functions[kind]
    elif kind is nn.ELU and module.alpha == 1.0:
        yield "elu"
    elif kind is nn.LeakyReLU and module.negative_slope == 0.01:
        yield "leaky_relu"
    elif kind in (nn.Hardtanh, nn.ReLU6):
        yield from _clip(module.min_val, module.max_val)
    elif kind not in (nn.Flatten, nn.Identity) and not _is_idle_dropout(module, nn):
        raise InvalidInputError(f"cannot convert {module!r}; what can be converted: {CONVERTED}")


def linear_layer(module: Any) -> Layer:
    """The map of an ``nn.Linear``."""
    weights = module.weight.detach().cpu().numpy().astype(np.float64)
    if module.bias is None:
        return Layer(weights, np.zeros(len(weights)))
    return Layer(weights, module.bias.detach().cpu().numpy().astype(np.float64))


def _clip(low: float, high: float) -> Iterator[Piece]:
    """Limits of an ``nn.Hardtanh``."""
    if (low, high) == (-1.0, 1.0):
        yield "hardtanh"
    else:
        yield Clip(np.array(float(low)), np.array(float(high)))


def _is_idle_dropout(module: Any, nn: Any) -> bool:
    """Whether a module is a dropout that drops nothing."""
    return type(module) is nn.Dropout and (not module.training or module.p == 0.0)
