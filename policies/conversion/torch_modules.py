"""Plain feed-forward networks of PyTorch as policies."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kinarm.errors import InvalidInputError, MissingExtraError
from kinarm.observation import observation_size
from kinarm.policies.conversion.pieces import Clip, Piece, chained
from kinarm.policies.policy import Layer, Policy
from kinarm.policies.provenance import Provenance, package_versions
from kinarm.problem import ReachProblem

CONVERTED = (
    "Sequential, Linear, Tanh, ReLU, ELU (alpha 1), LeakyReLU (slope 0.01), SiLU, Hardtanh, "
    "Flatten, Identity, and Dropout after eval()"
)
"""Modules that can be converted, for messages."""


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
