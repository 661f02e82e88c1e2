"""Affine maps, clips and activation functions, one after the other, as layers of a policy."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.errors import InvalidInputError
from kinarm.networks import Activation
from kinarm.policies.policy import Layer


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
