"""Batches of networks."""

from itertools import pairwise

import numpy as np
import pytest

from kinarm.errors import InvalidInputError
from kinarm.kernels import dense
from kinarm.networks import CompiledPolicy, Networks


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


def test_collect_refuses_nothing_and_mixtures():
    narrow = Offering(Networks.linear(np.ones((1, 1, 3)), np.zeros((1, 1))))
    wide = Offering(Networks.linear(np.ones((1, 1, 4)), np.zeros((1, 1))))
    with pytest.raises(InvalidInputError, match="polic"):
        Networks.collect([])
    with pytest.raises(InvalidInputError, match="must share layers"):
        Networks.collect([narrow, wide])


def test_compiled_deep_network_equals_numpy(simulator):
    rng = np.random.default_rng(0)
    w1, b1 = rng.normal(size=(48, 7)) / 7, rng.normal(size=7)
    w2, b2 = rng.normal(size=(7, 9)), rng.normal(size=9)
    w3, b3 = rng.normal(size=(9, 5)) / 3, rng.normal(size=5) / 3
    flat = np.concatenate([part.ravel() for part in (w1, b1, w2, b2, w3, b3)])[None]
    starts, goals = simulator.sample(rng, 100)
    seen = simulator.reset(starts, goals).observation
    chosen = np.tanh(np.tanh(seen @ w1 + b1) @ w2 + b2) @ w3 + b3
    assert (np.abs(chosen) > 1).any()
    assert (np.abs(chosen) < 1).any()
    rollouts = simulator.rollout(
        Networks(np.array([48, 7, 9, 5]), flat), starts, goals, record=True
    )
    first = rollouts.steps > 1
    expected = np.clip(
        starts[:, :5] + np.clip(chosen, -1, 1) * simulator.step_limit,
        simulator.arm.lower[:5],
        simulator.arm.upper[:5],
    )
    assert first.sum() > 50
    np.testing.assert_allclose(rollouts.paths[first, 1, :5], expected[first], rtol=0, atol=1e-12)


@pytest.mark.parametrize("n_actions", [1, 4, 6])
@pytest.mark.parametrize("width", [3, 15, 16, 40])
def test_layers_of_any_width_are_evaluated(n_actions, width):
    """Narrow and wide layers take different ways through the kernel."""
    rng = np.random.default_rng(width)
    widths = [9, width, width + 1, n_actions]
    parts = [rng.normal(size=(i + 1, o)) / 3 for i, o in pairwise(widths)]
    x = rng.normal(size=9)
    expected = x
    for number, part in enumerate(parts):
        expected = (np.tanh(expected) if number else expected) @ part[:-1] + part[-1]
    action, hidden = np.empty(n_actions), np.empty((2, max(widths)))
    weights = np.concatenate([part.reshape(-1) for part in parts])[None]
    dense(np.array(widths), weights, 0, x[None], 0, hidden, action)
    np.testing.assert_allclose(action, np.clip(expected, -1, 1), rtol=0, atol=1e-12)
