"""Batches of networks."""

import numpy as np
import pytest

from kinarm.errors import InvalidInputError
from kinarm.networks import CompiledPolicy, Layer, Mirror, Networks, split_parameters


class Offering:
    """The least that counts as a policy."""

    def __init__(self, networks):
        self._networks = networks

    def networks(self):
        return self._networks


def test_parameters_are_inputs_by_outputs_then_the_bias():
    layers = (Layer([[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]], [[7.0, 8.0]]), Layer([[[9, 10]]], [[11]]))
    networks = Networks(layers)
    assert (networks.widths, len(networks)) == ((3, 2, 1), 1)
    np.testing.assert_array_equal(networks.parameters, [[1, 4, 2, 5, 3, 6, 7, 8, 9, 10, 11]])
    for mine, split in zip(layers, split_parameters(networks.parameters, (3, 2, 1)), strict=True):
        np.testing.assert_array_equal(split.weights, mine.weights)
        np.testing.assert_array_equal(split.bias, mine.bias)


def test_a_policy_offers_its_networks_and_others_are_refused():
    batch = Networks((Layer(np.ones((2, 1, 3)), np.zeros((2, 1))),))
    one = Offering(batch)
    assert Networks.of(batch) is Networks.of(one) is batch
    assert isinstance(one, CompiledPolicy)
    with pytest.raises(InvalidInputError, match=r"offers networks\(\) or a function, got \[<"):
        Networks.of([one])


@pytest.mark.parametrize(
    ("layers", "message"),
    [
        ([], "at least one layer"),
        # As inputs x outputs, the order of other libraries.
        (
            [Layer(np.zeros((1, 48, 16)), np.zeros((1, 16)))],
            r"bias of layer 0 must have shape \(1, 48\), got \(1, 16\)",
        ),
        (
            [Layer(np.zeros((1, 2, 3)), np.zeros((1, 2))), Layer(np.zeros((1, 1, 3)), [[0.0]])],
            r"weights of layer 1 must have shape \(1, n, 2\), got \(1, 1, 3\)",
        ),
    ],
)
def test_layers_have_to_fit(layers, message):
    with pytest.raises(InvalidInputError, match=message):
        Networks(tuple(layers))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"rates": 2}, "rates must be the first of 2 observations"),
        ({"rates": -2}, "rates must be"),
        ({"mirror": Mirror(np.ones(4), np.ones(2))}, "mirror of observations must have shape"),
        ({"mirror": Mirror(np.ones(3), np.ones(3))}, "mirror of actions must have shape"),
        ({"mirror": Mirror(np.ones(3), np.ones(2), side=3)}, "side of the mirror .* at most 2"),
    ],
)
def test_what_kernels_read_has_to_be_there(given, message):
    layer = Layer(np.zeros((1, 2, 3)), np.zeros((1, 2)))
    with pytest.raises(InvalidInputError, match=message):
        Networks((layer,), **given)


def test_every_layer_needs_a_function_that_there_is():
    layer = Layer(np.zeros((1, 2, 3)), np.zeros((1, 2)))
    with pytest.raises(InvalidInputError, match="function 'sine' .*available: linear, tanh, relu"):
        Networks((layer,), activations=("sine",))
