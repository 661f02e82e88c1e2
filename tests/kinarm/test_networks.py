"""Batches of networks."""

import numpy as np
import pytest

from kinarm.errors import InvalidInputError
from kinarm.networks import CompiledPolicy, Mirror, Networks
from kinarm.observation import observation_signs


class Offering:
    """The least that counts as a policy."""

    def __init__(self, networks):
        self._networks = networks

    def networks(self):
        return self._networks


def test_linear_stores_inputs_by_outputs_then_the_bias():
    matrices = np.array([[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]])
    networks = Networks.linear(matrices, np.array([[7.0, 8.0]]))
    np.testing.assert_array_equal(networks.layers, [3, 2])
    np.testing.assert_array_equal(networks.weights, [[1, 4, 2, 5, 3, 6, 7, 8]])


def test_collect_gathers_one_many_or_a_batch():
    batch = Networks.linear(np.ones((2, 1, 3)), np.zeros((2, 1)))
    one = Offering(Networks.linear(np.full((1, 1, 3), 2.0), np.ones((1, 1))))
    assert Networks.collect(batch) is batch
    np.testing.assert_array_equal(Networks.collect(one).weights, [[2, 2, 2, 1]])
    np.testing.assert_array_equal(Networks.collect([one, one]).weights, [[2, 2, 2, 1]] * 2)
    assert isinstance(one, CompiledPolicy)


@pytest.mark.parametrize(
    ("layers", "weights", "message"),
    [
        ([3, 0], np.zeros((1, 0)), "at least two widths"),
        ([3, 2], np.zeros((1, 9)), r"weights must have shape \(n, 8\), got \(1, 9\)"),
        ([3, 2], np.full((1, 8), np.nan), "weights must be finite"),
    ],
)
def test_weights_have_to_fit_the_layers(layers, weights, message):
    with pytest.raises(InvalidInputError, match=message):
        Networks(np.array(layers), weights)


def test_every_layer_needs_a_function_that_there_is():
    with pytest.raises(InvalidInputError, match="function 'sine' .*available: linear, tanh, relu"):
        Networks(np.array([3, 2]), np.zeros((1, 8)), activations=("sine",))


class TestForm:
    """What policies of one rollout have to share."""

    def make(self, n_inputs=3, **changes):
        settings = {"activations": ("tanh",), "mirror": Mirror(-np.ones(3), np.ones(2)), **changes}
        weights = np.random.default_rng(0).normal(size=(1, 2 * n_inputs + 2))
        return Offering(Networks(np.array([n_inputs, 2]), weights, **settings))

    def test_is_kept_by_a_batch(self):
        batch = Networks.collect([self.make() for _ in range(4)])
        assert batch.weights.shape == (4, 8)
        assert batch.form == self.make().networks().form

    @pytest.mark.parametrize(
        "change",
        [
            {"activations": ("linear",)},
            {"n_inputs": 4},
            {"mirror": None},
            {"mirror": Mirror(-np.ones(3), -np.ones(2))},
        ],
    )
    def test_mixtures_are_refused(self, change):
        with pytest.raises(InvalidInputError, match="must share layers, functions and mirror"):
            Networks.collect([self.make(), self.make(**change)])


class TestMirror:
    def test_reflects_what_has_its_goal_on_the_left(self, simulator):
        signs = observation_signs(6)
        mirror = Mirror(signs, np.ones(5))
        seen = simulator.world.observe(*simulator.sample(np.random.default_rng(3), 50))
        left = mirror.on_the_left(seen)
        np.testing.assert_array_equal(left, seen[:, 1] > 0)
        assert 10 < left.sum() < 40
        reflected = mirror.from_the_right(seen)
        np.testing.assert_array_equal(reflected[~left], seen[~left])
        np.testing.assert_array_equal(reflected[left], seen[left] * signs)
        assert not mirror.on_the_left(reflected).any()
