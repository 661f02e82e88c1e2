"""Networks as policies of Augmented Random Search, and its normal numbers."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numba import njit
from scipy import stats

from kinarm.kernels.lanes import LANES
from kinarm.networks import split_parameters
from kinarm.observation_layout import ObservationLayout
from kinarm.policies import ARSConfig, train_policy
from kinarm.policies.ars.networks import (
    initial_network,
    logarithm,
    normal_pairs,
    perturbations,
    perturbed_networks,
)
from kinarm.policies.normalizer import Normalizer
from kinarm.problem import PROBLEMS
from kinarm.simulator import Simulator

WIDTHS = (7, 5, 3, 2)
TINY = ARSConfig(iterations=3, directions=4, top_directions=2, net_arch=(6,), problem="both")


def forward(layers, inputs):
    """Layer by layer, with tanh between them."""
    for number, (weights, bias) in enumerate(layers):
        inputs = weights @ (np.tanh(inputs) if number else inputs) + bias
    return inputs


def by_networks(networks, row, observation):
    """What a row of `Networks` answers, read as its documentation says."""
    return forward([(weights[row], bias[row]) for weights, bias in networks.layers], observation)


@pytest.mark.parametrize("n_joints", [5, 7])
def test_first_network_does_nothing_and_hears_all_parts_alike(n_joints):
    layout = ObservationLayout.sized(PROBLEMS["right"], n_joints, n_joints)
    n, parts = sum(map(layout.length, layout.parts)), layout.places.values()
    theta = initial_network(np.random.default_rng(0), layout, (4000, 50, 2))
    assert theta.shape == (1, (n + 1) * 4000 + 4001 * 50 + 51 * 2)
    first, second, last = split_parameters(theta, (n, 4000, 50, 2))
    drawn = perturbations(np.random.default_rng(0), (n, 4000))
    heard = [np.square(first.weights[0].T[part] / drawn[part]).sum(axis=0) for part in parts]
    np.testing.assert_allclose(heard, 1.5**2 / len(heard))
    assert second.weights.std() == pytest.approx(4000**-0.5, rel=0.05)
    still = (first.bias, second.bias, last.weights, last.bias)
    assert not any(array.any() for array in still)


def test_perturbed_networks_take_raw_observations():
    rng = np.random.default_rng(1)
    theta = rng.normal(size=(1, sum(a * b + b for a, b in pairwise(WIDTHS))))
    step = 0.1 * rng.normal(size=(3, *theta.shape))
    data = rng.normal([1, 2, 3, 4, 5, 6, 7], [1, 2, 1, 2, 1, 2, 0], (50, 7))
    normalizer, x = Normalizer.of(data), rng.normal(size=7)
    scale = np.where(normalizer.std > 0, 1 / np.maximum(normalizer.std, 1e-9), 0)
    networks = perturbed_networks(theta, step, normalizer, WIDTHS)
    for row in range(6):
        parameters = theta + step[row] if row < 3 else theta - step[row - 3]
        layers = [(weights[0], bias[0]) for weights, bias in split_parameters(parameters, WIDTHS)]
        expected = forward(layers, (x - normalizer.mean) * scale)
        np.testing.assert_allclose(by_networks(networks, row, x), expected, atol=1e-12)


def test_policy_has_the_trained_parameters():
    result = train_policy(TINY)
    still = np.zeros((1, *result.state.theta.shape))
    normalizer = Normalizer(1, result.policy.mean, result.policy.std**2)
    trained = perturbed_networks(result.state.theta, still, normalizer, (48, 6, 5))
    networks = result.policy.networks()
    assert networks.widths == (48, 6, 5)
    np.testing.assert_allclose(networks.parameters, trained.parameters[:1], rtol=1e-12, atol=1e-14)
    assert result.state.theta[0, -6 * 5 - 5 :].any()


def test_threads_and_interruptions_change_nothing():
    states = []
    whole = train_policy(TINY, threads=2, on_iteration=states.append)
    resumed = train_policy(TINY, threads=1, state=states[0])
    np.testing.assert_array_equal(resumed.state.theta, whole.state.theta)


def test_symmetric_networks_see_goals_on_the_left_in_the_mirror():
    policy = train_policy(replace(TINY, symmetric=True, problem="both")).policy
    simulator = Simulator("both", threads=1)
    starts, goals = simulator.sample(np.random.default_rng(0), 40)
    signs = np.array([-1, 1, 1, -1, 1, -1])
    first = simulator.rollout(policy, starts, goals)
    second = simulator.rollout(policy, starts * signs, goals * [1, -1, 1])
    np.testing.assert_array_equal(first.steps, second.steps)
    np.testing.assert_allclose(first.distance, second.distance, rtol=0, atol=1e-9)


class TestPerturbations:
    def test_are_those_of_box_and_muller(self):
        drawn = perturbations(np.random.default_rng(1), (3, 5, 48))
        radius, angle = np.random.default_rng(1).random((2, 360))
        radius, angle = np.sqrt(-2 * np.log1p(-radius)), 2 * np.pi * angle
        expected = [radius * np.cos(angle), radius * np.sin(angle)]
        np.testing.assert_allclose(drawn, np.reshape(expected, (3, 5, 48)), rtol=0, atol=1e-14)

    @pytest.mark.parametrize("shape", [(1, 1, 1), (2, 3, 3), (1, 2, 8), (4, 1, 7)])
    def test_any_number_of_them(self, shape):
        drawn = perturbations(np.random.default_rng(2), shape)
        assert drawn.shape == shape
        assert (drawn != 0).all()
        assert len(np.unique(drawn)) == drawn.size

    def test_are_normal_and_independent(self):
        drawn = perturbations(np.random.default_rng(3), (200_000,))
        assert stats.kstest(drawn, "norm").pvalue > 0.01
        assert stats.kstest(drawn[:-1] * drawn[1:], drawn[::-1][:-2] * drawn[2:]).pvalue > 0.01
        assert abs(np.corrcoef(drawn[:100_000], drawn[100_000:])[0, 1]) < 0.01
        assert abs(np.corrcoef(drawn[:100_000] ** 2, drawn[100_000:] ** 2)[0, 1]) < 0.01

    def test_the_least_likely_are_finite(self):
        numbers = np.zeros((2, 1, LANES))
        numbers[0, 0, :3] = (0.0, 1 - 2.0**-53, 0.5)
        normal_pairs(numbers)
        expected = [0, np.sqrt(2 * 53 * np.log(2)), np.sqrt(2 * np.log(2))]
        np.testing.assert_allclose(numbers[0, 0, :3], expected, rtol=1e-15)


@njit
def logarithms(numbers):
    return np.array([logarithm(number) for number in numbers])


def test_logarithm():
    rng = np.random.default_rng(4)
    x = np.concatenate([1 - rng.random(10_000), 2.0 ** -np.arange(54), rng.random(1000) * 1e-9])
    np.testing.assert_allclose(logarithms(x), np.log(x), rtol=4e-16)
