"""A network and its mirror image in one."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from kinarm.errors import InvalidInputError
from kinarm.policies import Layer
from kinarm.policies.mirror import Mirror
from kinarm.policies.symmetric_layers import symmetric_layers
from kinarm.simulator import Simulator


@pytest.fixture(scope="module")
def mirror(simulator):
    return Mirror.of(simulator)


@pytest.fixture(scope="module")
def situations(simulator):
    """Observations of random situations, goals on both sides."""
    return simulator.observe(*simulator.sample(np.random.default_rng(0), 400))


def lively(policy, gain):
    """The same policy with larger weights, so that its units saturate more or less."""
    layers = tuple(Layer(gain * layer.weights, layer.bias) for layer in policy.layers)
    return replace(policy, layers=layers)


def doubled(policy, mirror):
    return replace(policy, layers=symmetric_layers(policy.layers, policy.mean, policy.std, mirror))


@pytest.mark.parametrize("hidden", [(6, 7), (9, 8, 7), (5, 5, 5, 5)])
@pytest.mark.parametrize("gain", [1, 30])
def test_acts_as_given_on_the_right_and_as_its_image_on_the_left(
    make_policy, mirror, situations, hidden, gain
):
    policy = lively(make_policy(*hidden, constant=1), gain)
    both = doubled(policy, mirror)
    left = situations[:, 1] > 0
    assert 100 < left.sum() < 300
    right_actions = policy(situations[~left])
    assert right_actions.std(axis=0).max() > 1e-3
    np.testing.assert_allclose(both(situations[~left]), right_actions, rtol=0, atol=1e-11)
    image = policy(situations[left] * mirror.observations) * mirror.actions
    np.testing.assert_allclose(both(situations[left]), image, rtol=0, atol=1e-11)


def test_compiled_rollouts_mirror_each_other(make_policy, mirror):
    both = doubled(lively(make_policy(8, 8, seed=1), 30), mirror)
    simulator = Simulator(task="both", threads=1)
    starts, goals = simulator.sample(np.random.default_rng(1), 200)
    first = simulator.rollout(both, starts, goals, record=True)
    second = simulator.rollout(both, starts * mirror.axes, goals * [1, -1, 1], record=True)
    np.testing.assert_array_equal(first.collision, second.collision)
    np.testing.assert_array_equal(first.steps, second.steps)
    np.testing.assert_allclose(first.paths * mirror.axes, second.paths, rtol=0, atol=1e-7)


def test_widths(make_policy, mirror):
    layers = doubled(make_policy(6, 7), mirror).layers
    widths = [48, *(len(layer.bias) for layer in layers)]
    assert widths == [48, 13, 15, 5]
    for layer, (n_in, n_out) in zip(layers, itertools.pairwise(widths), strict=True):
        assert layer.weights.shape == (n_out, n_in)


@pytest.mark.parametrize("hidden", [(), (6,)])
def test_too_few_layers_are_refused(make_policy, mirror, hidden):
    with pytest.raises(InvalidInputError, match=f"at least two hidden layers, got {len(hidden)}"):
        doubled(make_policy(*hidden), mirror)
