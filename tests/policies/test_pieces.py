"""Maps, clips and functions in a row, as layers of a policy."""

import numpy as np
import pytest

from kinarm.errors import InvalidInputError
from kinarm.networks import ACTIVATIONS
from kinarm.policies.conversion.layers import Clip, chained
from kinarm.policies.policy import Layer


def layer(n_out, n_in, seed=0):
    rng = np.random.default_rng(seed)
    return Layer(rng.normal(size=(n_out, n_in)), rng.normal(size=n_out))


def run_pieces(pieces, x):
    for piece in pieces:
        if isinstance(piece, Layer):
            x = x @ piece.weights.T + piece.bias
        elif isinstance(piece, Clip):
            x = np.clip(x, piece.low, piece.high)
        else:
            x = ACTIVATIONS[piece](x)
    return x


def run_chain(layers, activations, x):
    for (weights, bias), name in zip(layers, activations, strict=True):
        x = ACTIVATIONS[name](x @ weights.T + bias)
    return x


@pytest.mark.parametrize(
    ("pieces", "activations"),
    [
        ([layer(4, 3), "tanh", layer(2, 4)], ("tanh", "linear")),
        ([layer(4, 3), layer(2, 4)], ("linear",)),
        ([layer(4, 3), "relu", "tanh"], ("relu", "tanh")),
        (["tanh", layer(2, 3)], ("tanh", "linear")),
        ([], ("linear",)),
        ([Clip(np.array(-2.0), np.array(2.0)), layer(2, 3), "tanh"], ("hardtanh", "tanh")),
        ([layer(4, 3), Clip(np.array(-0.5), np.array(2.5))], ("hardtanh", "linear")),
        (
            [Clip(np.array([-0.1, -9, -1]), np.array([0.2, 9, 1])), "relu", layer(2, 3)],
            ("hardtanh", "relu", "linear"),
        ),
    ],
)
def test_a_chain_does_what_its_pieces_do(pieces, activations):
    layers, found = chained(pieces, 3)
    assert found == activations
    x = np.random.default_rng(1).normal(size=(200, 3)) * 2
    np.testing.assert_allclose(
        run_chain(layers, found, x), run_pieces(pieces, x), rtol=0, atol=1e-12
    )


def test_maps_that_do_not_fit_are_refused():
    with pytest.raises(InvalidInputError, match="a layer takes 5 inputs where 4 arrive"):
        chained([layer(4, 3), layer(2, 5)], 3)


def test_a_map_alone_is_kept_as_it_is():
    only = layer(2, 3)
    [kept], _ = chained([only], 3)
    np.testing.assert_array_equal(kept.weights, only.weights)
