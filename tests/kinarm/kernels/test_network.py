"""Compiled networks of all widths and functions, mirrored or not, against NumPy."""

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import njit, typeof

from kinarm.kernels.compiling import call_stage
from kinarm.kernels.lanes import LANES, as_numbers
from kinarm.kernels.network import ACT_BY_NETWORKS, shared_policy
from kinarm.kernels.records import recorded
from kinarm.kernels.work_space import work_space
from kinarm.networks import Layer, Mirror, Networks, network_control
from kinarm.policies.arm_policy import activated

FUNCTIONS = {
    "linear": lambda x: x,
    "tanh": np.tanh,
    "relu": lambda x: np.where(x > 0, x, 0.0),
    "hardtanh": lambda x: np.minimum(np.maximum(x, -1.0), 1.0),
    "elu": lambda x: np.where(x > 0, x, np.exp(np.minimum(x, 0.0)) - 1.0),
    "leaky_relu": lambda x: np.where(x > 0, x, 0.01 * x),
    "silu": lambda x: x / (1.0 + np.exp(-x)),
}
SEVEN = ("hardtanh", "silu", "elu", "leaky_relu", "tanh", "relu", "linear")


class Actor(NamedTuple):
    """What a session's stage of networks reads."""

    control: Any
    block: Any


@njit
def act_all(stage, actor, observations, actions):
    n, control, block = len(observations), actor.control, actor.block
    shared, own = shared_policy(n, control), block.weights.shape[1]
    given, weights = as_numbers(block.observation), as_numbers(block.weights)
    chosen = as_numbers(block.action)
    for start in range(0, n, LANES):
        for lane in range(min(LANES, n - start)):
            for i in range(given.shape[1]):
                given[0, i, lane] = observations[start + lane, i]
            for i in range(own):
                weights[0, i, lane] = control.weights[control.policy[start + lane], i]
        call_stage(stage, (actor, shared))
        for lane in range(min(LANES, n - start)):
            for i in range(chosen.shape[1]):
                actions[start + lane, i] = chosen[0, i, lane]


def compiled(networks, observations):
    """Actions of networks, one for each observation or one for all."""
    count, widths = len(observations), (networks.widths[0], networks.widths[-1])
    control = network_control(networks, None, count, widths)
    actions = np.full((count, widths[1]), np.nan)
    block, _ = work_space(
        n_joints=0,
        n_actuated=widths[1],
        n_observations=widths[0],
        widest=max(control.layers),
        own=control.weights.shape[1] if len(control.weights) > 1 else 0,
    )
    actor = recorded(Actor(recorded(control), block))
    act_all(ACT_BY_NETWORKS.address(typeof(actor)), actor, observations, actions)
    return actions.clip(-1, 1)


def random_networks(widths, count=1, seed=0, **settings):
    rng = np.random.default_rng(seed)
    layers = tuple(
        Layer(
            rng.normal(size=(count, n_out, n_in)) / np.sqrt(n_in),
            rng.normal(size=(count, n_out)) / np.sqrt(n_in),
        )
        for n_in, n_out in pairwise(widths)
    )
    return Networks(layers, **settings)


def in_numpy(networks, x, index=0):
    """What a network answers, clipped, without a mirror."""
    for layer, name in zip(networks.layers, networks.activations, strict=True):
        x = FUNCTIONS[name](x @ layer.weights[index].T + layer.bias[index])
    return np.clip(x, -1, 1)


@pytest.mark.parametrize(("n_actions", "width"), [(1, 3), (4, 4), (6, 5), (4, 16), (6, 41)])
def test_layers_of_any_width(n_actions, width):
    """Sums are taken five at a time."""
    networks = random_networks([9, width, width + 1, n_actions])
    x = np.random.default_rng(width).normal(size=(20, 9))
    actions = compiled(networks, x)
    np.testing.assert_allclose(actions, in_numpy(networks, x), rtol=0, atol=1e-12)
    assert (np.abs(actions) < 1).any()


@pytest.mark.parametrize("names", [(name,) for name in FUNCTIONS] + [SEVEN, SEVEN[::-1]])
def test_every_layer_has_a_function_of_its_own(names):
    networks = random_networks(
        [8, *(20, 17, 18, 9, 16, 21)[: len(names) - 1], 5], activations=names
    )
    x = np.random.default_rng(6).normal(size=(50, 8)) * 2
    expected = in_numpy(networks, x)
    np.testing.assert_allclose(compiled(networks, x), expected, rtol=0, atol=1e-12)
    assert expected.std() > 0.05


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_are_those_of_torch(name):
    torch = pytest.importorskip("torch")
    modules = {
        "linear": torch.nn.Identity(),
        "tanh": torch.nn.Tanh(),
        "relu": torch.nn.ReLU(),
        "hardtanh": torch.nn.Hardtanh(),
        "elu": torch.nn.ELU(),
        "leaky_relu": torch.nn.LeakyReLU(),
        "silu": torch.nn.SiLU(),
    }
    x = np.concatenate([np.linspace(-40, 40, 4001), [-1e3, -1e-9, -0.0, 0.0, 1e-9, 1e3]])[:, None]
    layers = (Layer([[[1.0]]], [[0.0]]), Layer([[[0.001]]], [[0.0]]))
    networks = Networks(layers, activations=(name, "linear"))
    expected = 0.001 * modules[name](torch.tensor(x)).numpy()
    np.testing.assert_allclose(compiled(networks, x), expected.clip(-1, 1), rtol=0, atol=1e-15)
    np.testing.assert_allclose(0.001 * activated(np, name, x), expected, rtol=0, atol=1e-15)


def test_each_observation_has_its_own_network():
    networks = random_networks([6, 5, 3], count=10)
    x = np.random.default_rng(2).normal(size=(10, 6))
    expected = [in_numpy(networks, row, index) for index, row in enumerate(x)]
    np.testing.assert_allclose(compiled(networks, x), expected, rtol=0, atol=1e-12)


class TestMirror:
    """The y of the goal, entry 1, tells the side: positive is left."""

    @pytest.fixture
    def mirror(self):
        return Mirror(np.array([1.0, -1, 1, -1, 1, 1, -1]), np.array([-1.0, 1, -1]))

    @pytest.mark.parametrize("hidden", [(), (20, 5)])
    def test_goals_on_the_left_are_seen_in_it(self, mirror, hidden):
        plain = random_networks([7, *hidden, 3])
        mirrored = random_networks([7, *hidden, 3], mirror=mirror)
        x = np.random.default_rng(3).normal(size=(60, 7))
        left = x[:, 1] > 0
        actions = compiled(mirrored, x)
        assert 10 < left.sum() < 50
        np.testing.assert_array_equal(actions[~left], compiled(plain, x)[~left])
        image = compiled(plain, x * mirror.observations) * mirror.actions
        np.testing.assert_array_equal(actions[left], image[left])
        by_hand = in_numpy(plain, x[left] * mirror.observations) * mirror.actions
        np.testing.assert_allclose(actions[left], by_hand, rtol=0, atol=1e-12)

    def test_a_goal_straight_ahead_is_seen_as_it_is(self, mirror):
        x = np.random.default_rng(4).normal(size=(5, 7))
        x[:, 1] = [0.0, -0.0, 0.0, 1e-300, -1e-300]
        plain, mirrored = random_networks([7, 3]), random_networks([7, 3], mirror=mirror)
        same = (compiled(plain, x) == compiled(mirrored, x)).all(axis=1)
        assert same.tolist() == [True, True, True, False, True]
