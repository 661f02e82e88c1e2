"""The slow reference by hand, and the compiled rollouts held against it."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from reference_episodes import assert_equal_outcome, compare_actions, scripted
from simulators import changed

from kinarm.networks import Layer, Networks, split_parameters
from kinarm.policies.arm_policy import activated
from kinarm.policies.library import load_policy
from kinarm.problem import ReachProblem
from kinarm.scene import GoalRegion, Obstacle, Scene
from kinarm.simulator import Simulator
from kinarm.task import ReachTask, RewardWeights
from tests.helpers.reference import ReferenceSimulator

REWARD = RewardWeights(progress=1.5, closer=0.03, collision=-0.7, success=0.4, step=-0.01)


def simulator_of(problem="right", **overrides):
    """A simulator in which each reward term counts."""
    made = ReachProblem.load(problem).replace(reward=REWARD, tested_configurations=4)
    return Simulator(made.replace(**overrides), threads=1)


def still(_):
    return np.zeros(5)


@pytest.fixture(scope="module")
def long_reach():
    """The default arm with a wide tolerance, so that good policies succeed often.

    Policies may rest at the limits, where rounding decides what is closer: that is not rewarded.
    """
    return changed(simulator_of(tolerance=0.1), reward={"closer": 0})


def trained_networks(name, count, seed):
    """A shipped policy, more and more disturbed."""
    trained = load_policy(name).networks()
    spread = np.linspace(0, 0.4, count)[:, None]
    size = trained.parameters.size
    gains = 1 + spread * np.random.default_rng(seed).normal(size=(count, size))
    layers = split_parameters(trained.parameters * gains, trained.widths)
    return replace(trained, layers=tuple(layers))


def random_networks(simulator, count, seed, hidden=(), **functions):
    rng = np.random.default_rng(seed)
    widths = [simulator.n_observations, *hidden, simulator.n_actions]
    layers = tuple(
        Layer(
            rng.normal(size=(count, n_out, n_in)) * 2 / np.sqrt(n_in),
            rng.normal(size=(count, n_out)) / 4,
        )
        for n_in, n_out in itertools.pairwise(widths)
    )
    return Networks(layers, **functions)


def evaluate(networks, index, observation):
    """One network in plain NumPy."""
    x, mirror = observation, networks.mirror
    left = mirror is not None and observation[1] > 0
    x = mirror.observations * x if left else x
    for layer, name in zip(networks.layers, networks.activations, strict=True):
        x = np.einsum("ji,i->j", layer.weights[index], x) + layer.bias[index]
        x = activated(np, name, x)
    action = np.clip(x, -1, 1)
    return mirror.actions * action if left else action


def compare_networks(simulator, networks, seed, count, atol=1e-12):
    """Run the same episodes on both sides; return how they ended."""
    starts, goals = simulator.sample(np.random.default_rng(seed), count)
    index = np.arange(count) % len(networks)
    rollouts = simulator.rollout(networks, starts, goals, policy_index=index, record=True)
    reference = ReferenceSimulator(simulator)
    for i in range(count):
        episode = reference.rollout(
            lambda seen, k=index[i]: evaluate(networks, k, seen), starts[i], goals[i]
        )
        assert_equal_outcome(simulator, rollouts, i, episode, atol)
    return np.array([rollouts.success.sum(), rollouts.collision.sum(), count])


class TestByHand:
    def test_standing_still_earns_only_the_step_reward(self, long_reach):
        goal = np.array([0.0, 0.65, 0.325])
        episode = ReferenceSimulator(long_reach).rollout(still, np.zeros(6), goal)
        np.testing.assert_allclose(episode.rewards, np.full(64, -0.01), atol=1e-15)
        assert (episode.success, episode.collision, episode.contact) == (False, False, None)
        np.testing.assert_allclose(episode.distance, np.linalg.norm(goal - [0.625, 0, 0.705]))

    def test_turning_the_base_moves_it_by_its_rated_speed(self, long_reach):
        turn, goal = scripted(np.tile([1, 0, 0, 0, 0], (64, 1))), np.array([5.0, 0, 0])
        episode = ReferenceSimulator(long_reach).rollout(turn, np.zeros(6), goal)
        expected = np.minimum(np.deg2rad(7) * np.arange(65), np.pi)
        np.testing.assert_allclose(episode.path[:, 0], expected, atol=1e-12)
        np.testing.assert_array_equal(episode.path[:, 1:], 0)

    def test_goal_within_the_tolerance_ends_the_episode(self, long_reach):
        episode = ReferenceSimulator(long_reach).rollout(
            still, np.zeros(6), np.array([0.625, 0.09, 0.705])
        )
        assert episode.success
        np.testing.assert_allclose(episode.rewards, [0.4 - 0.01])

    def test_falling_forward_ends_in_contact(self, long_reach):
        fall, goal = scripted(np.tile([0, 1, 0, 0, 0], (64, 1))), np.array([0, 5.0, 1])
        episode = ReferenceSimulator(long_reach).rollout(fall, np.zeros(6), goal)
        assert episode.collision
        assert episode.contact == ("hand", "ground")
        assert episode.rewards[-1] == pytest.approx(-0.7 - 0.01)
        np.testing.assert_array_equal(episode.path[-1], episode.path[-2])


@pytest.mark.slow
class TestCompiledRolloutsEqualTheReference:
    @pytest.mark.parametrize("hidden", [(), (16, 12)])
    @pytest.mark.parametrize("name", ["paper", "lrmate200ic_5l"])
    def test_random_policies(self, simulators, name, hidden):
        simulator = simulators[name]
        ends = compare_networks(simulator, random_networks(simulator, 50, 1, hidden), 2, 100)
        assert 10 < ends[1] < 98

    def test_trained_policies(self, long_reach):
        # Closed loops amplify the rounding in which the two evaluations of a network differ.
        networks = trained_networks("ars-tuned-both-seed0", 20, 5)
        ends = compare_networks(long_reach, networks, 6, 120, atol=1e-9)
        success, collision, count = ends
        assert min(success, collision, count - success - collision) > 10

    @pytest.mark.parametrize(
        ("name", "problem"),
        [("paper", "left"), ("paper_flange", "right"), ("lrmate200ic_5l", "left")],
    )
    def test_action_tables(self, name, problem):
        simulator = simulator_of(problem, arm=name)
        ends = compare_actions(simulator, 7, 120)
        assert ends[1] > 7

    @pytest.mark.parametrize("name", ["mesh", "sliding"])
    def test_generic_arms(self, simulators, name):
        simulator = simulators[name]
        ends = compare_actions(simulator, 8, 120)
        ends += compare_networks(simulator, random_networks(simulator, 20, 9), 10, 80)
        assert 10 < ends[1] < 190


def test_short_episodes_of_other_time_steps():
    simulator = simulator_of(horizon=7, tolerance=0.4, time_step=0.1)
    success, collision, count = compare_actions(simulator, 11, 120, held=3)
    assert collision > 5
    assert success > 1
    assert count > collision + success


@pytest.mark.parametrize("tested", [1, 5, 32])
def test_other_numbers_of_tested_configurations(tested):
    """Steps are long, so that the number matters."""
    simulator = simulator_of(horizon=12, time_step=0.08)
    _, collision, count = compare_actions(simulator, 12, 60, held=3, tested=tested)
    assert 5 < collision < count - 5


def test_obstacles_and_thick_goal_regions_of_ones_own():
    post = Obstacle(name="post", lower=(0.45, -0.03, 0), upper=(0.5, 0.03, 1))
    ahead = GoalRegion(name="ahead", lower=(0.35, -0.4, 0.3), upper=(0.6, 0.4, 0.8))
    scene = Scene(obstacles=(post,), goal_regions=(ahead,))
    problem = ReachProblem(name="post", scene=scene, task=ReachTask(goal_regions=("ahead",)))
    simulator = simulator_of(problem, tolerance=0.15, horizon=32)
    success, collision, _ = compare_actions(simulator, 14, 150)
    assert success > 5
    assert collision > 5


@pytest.mark.parametrize(
    "activations", [("relu", "linear", "tanh"), ("silu", "leaky_relu", "hardtanh")]
)
def test_activation_functions(simulator, activations):
    networks = random_networks(simulator, 10, 15, hidden=(18, 7), activations=activations)
    ends = compare_networks(simulator, networks, 16, 30)
    assert ends[1] > 5


@pytest.mark.parametrize("name", ["ppo-paper-left-seed0", "ars-tuned-both-seed0"])
def test_shipped_policies(name):
    """One of PPO, and one of ARS, which has a mirror."""
    simulator = simulator_of(name.split("-")[2])
    ends = compare_networks(simulator, trained_networks(name, 10, 17), 18, 60, atol=1e-9)
    assert (ends > 2).all()
