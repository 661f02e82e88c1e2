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


def test_collect_gathers_one_many_or_a_batch():
    batch = Networks((Layer(np.ones((2, 1, 3)), np.zeros((2, 1))),))
    one = Offering(Networks((Layer(np.full((1, 1, 3), 2.0), np.ones((1, 1))),)))
    assert Networks.collect(batch) is batch
    np.testing.assert_array_equal(Networks.collect(one).parameters, [[2, 2, 2, 1]])
    np.testing.assert_array_equal(Networks.collect([one, one]).parameters, [[2, 2, 2, 1]] * 2)
    assert isinstance(one, CompiledPolicy)


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


def test_every_layer_needs_a_function_that_there_is():
    layer = Layer(np.zeros((1, 2, 3)), np.zeros((1, 2)))
    with pytest.raises(InvalidInputError, match="function 'sine' .*available: linear, tanh, relu"):
        Networks((layer,), activations=("sine",))


class TestForm:
    """What policies of one rollout have to share."""

    def make(self, n_inputs=3, **changes):
        settings = {"activations": ("tanh",), "mirror": Mirror(-np.ones(3), np.ones(2)), **changes}
        rng = np.random.default_rng(0)
        layer = Layer(rng.normal(size=(1, 2, n_inputs)), rng.normal(size=(1, 2)))
        return Offering(Networks((layer,), **settings))

    def test_is_kept_by_a_batch(self):
        batch = Networks.collect([self.make() for _ in range(4)])
        assert batch.parameters.shape == (4, 8)
        assert batch.form == self.make().networks().form

    @pytest.mark.parametrize(
        "change",
        [
            {"activations": ("linear",)},
            {"mirror": None},
            {"mirror": Mirror(-np.ones(3), -np.ones(2))},
        ],
    )
    def test_mixtures_are_refused(self, change):
        with pytest.raises(InvalidInputError, match="must share layers, functions and mirror"):
            Networks.collect([self.make(), self.make(**change)])


class TestMirror:
    def test_reflects_what_has_its_goal_on_the_left(self, simulator):
        signs = simulator.world.layout.signs(np.ones(6))
        mirror = Mirror(signs, np.ones(5))
        seen = simulator.world.observe(*simulator.sample(np.random.default_rng(3), 50))
        left = mirror.on_the_left(seen)
        np.testing.assert_array_equal(left, seen[:, 1] > 0)
        assert 10 < left.sum() < 40
        reflected = mirror.from_the_right(seen)
        np.testing.assert_array_equal(reflected[~left], seen[~left])
        np.testing.assert_array_equal(reflected[left], seen[left] * signs)
        assert not mirror.on_the_left(reflected).any()
