"""The slow reference by hand, and the compiled rollouts held against it."""

import itertools

import numpy as np
import pytest

from kinarm.networks import Networks
from kinarm.policies import ARSConfig, train_policy
from kinarm.reference import ReferenceSimulator
from kinarm.simulator import Simulator
from kinarm.task import ReachTask, RewardWeights

REWARD = RewardWeights(progress=1.5, closer=0.03, collision=-0.7, success=0.4, step=-0.01)


def task(**settings):
    return ReachTask(name="test", benches=("right",), reward=REWARD, **settings)


def still(_):
    return np.zeros(5)


@pytest.fixture(scope="module")
def long_reach():
    """The default arm with a wide tolerance, so that good policies succeed often."""
    return Simulator("paper", task(tolerance=0.1), threads=1)


def trained_networks(count, seed):
    """A linear policy after a short training, with several gains."""
    config = ARSConfig(sharing="iteration", episodes=2, iterations=300, step_size=0.05)
    trained = train_policy(config).policy.networks()
    gains = np.random.default_rng(seed).uniform(0.8, 1.2, (count, 1))
    return Networks(trained.layers, trained.weights * gains)


def random_networks(simulator, count, seed, hidden=()):
    rng = np.random.default_rng(seed)
    widths = [simulator.n_observations, *hidden, simulator.n_actions]
    parts = []
    for n_in, n_out in itertools.pairwise(widths):
        parts.append(rng.normal(size=(count, n_in * n_out)) * 2 / np.sqrt(n_in))
        parts.append(rng.normal(size=(count, n_out)) / 4)
    return Networks(np.array(widths), np.concatenate(parts, axis=1))


def evaluate(networks, index, observation):
    """One network in plain numpy."""
    x, offset, widths = observation, 0, networks.layers
    for n_in, n_out in itertools.pairwise(widths):
        x = np.tanh(x) if offset else x
        size = n_in * n_out
        weights = networks.weights[index, offset : offset + size].reshape(n_in, n_out)
        x = x @ weights + networks.weights[index, offset + size : offset + size + n_out]
        offset += size + n_out
    return x


def scripted(table):
    """A policy that plays the rows of a table."""
    rows = iter(table)
    return lambda _: next(rows)


def assert_equal_outcome(simulator, rollouts, i, episode, atol=1e-12):
    steps = len(episode.rewards)
    assert rollouts.success[i] == episode.success
    assert rollouts.collision[i] == episode.collision
    assert rollouts.steps[i] == steps
    np.testing.assert_allclose(rollouts.paths[i, : steps + 1], episode.path, rtol=0, atol=atol)
    assert np.isnan(rollouts.paths[i, steps + 1 :]).all()
    np.testing.assert_allclose(rollouts.distance[i], episode.distance, rtol=0, atol=atol)
    np.testing.assert_allclose(rollouts.returns[i], episode.rewards.sum(), rtol=0, atol=atol)
    np.testing.assert_array_equal(rollouts.configurations[i], rollouts.paths[i, steps])
    if episode.collision:
        pair = simulator.world.contact_pair(rollouts.configurations[i], rollouts.targets[i])
        assert pair == episode.contact


def compare_networks(simulator, networks, seed, count, atol=1e-12):
    """Run the same episodes on both sides; return how they ended."""
    starts, goals = simulator.sample(np.random.default_rng(seed), count)
    index = np.arange(count) % len(networks.weights)
    rollouts = simulator.rollout(networks, starts, goals, policy_index=index, record=True)
    reference = ReferenceSimulator(simulator)
    for i in range(count):
        episode = reference.rollout(
            lambda seen, k=index[i]: evaluate(networks, k, seen), starts[i], goals[i]
        )
        assert_equal_outcome(simulator, rollouts, i, episode, atol)
    return np.array([rollouts.success.sum(), rollouts.collision.sum(), count])


def compare_actions(simulator, seed, count, held=6):
    rng = np.random.default_rng(seed)
    horizon = simulator.task.horizon
    starts, goals = simulator.sample(rng, count)
    blocks = rng.uniform(-1.5, 1.5, (count, -(-horizon // held), simulator.n_actions))
    actions = np.repeat(blocks, held, axis=1)[:, :horizon]
    rollouts = simulator.rollout_actions(actions, starts, goals, record=True)
    reference = ReferenceSimulator(simulator)
    for i in range(count):
        episode = reference.rollout(scripted(actions[i]), starts[i], goals[i])
        assert_equal_outcome(simulator, rollouts, i, episode)
    return np.array([rollouts.success.sum(), rollouts.collision.sum(), count])


class TestByHand:
    def test_standing_still_earns_only_the_step_reward(self, long_reach):
        goal = np.array([0.0, 0.65, 0.325])
        episode = ReferenceSimulator(long_reach).rollout(still, np.zeros(6), goal)
        np.testing.assert_allclose(episode.rewards, np.full(64, -0.01), atol=1e-15)
        assert not episode.success
        assert not episode.collision
        assert episode.contact is None
        np.testing.assert_allclose(episode.distance, np.linalg.norm(goal - [0.625, 0, 0.705]))

    def test_turning_the_base_moves_it_by_its_rated_speed(self, long_reach):
        def turn(_):
            return np.array([1, 0, 0, 0, 0])

        episode = ReferenceSimulator(long_reach).rollout(turn, np.zeros(6), np.array([5.0, 0, 0]))
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
        def fall(_):
            return np.array([0, 1, 0, 0, 0])

        episode = ReferenceSimulator(long_reach).rollout(fall, np.zeros(6), np.array([0, 5.0, 1]))
        assert episode.collision
        assert episode.contact == ("hand", "ground")
        assert episode.rewards[-1] == pytest.approx(-0.7 - 0.01)
        np.testing.assert_array_equal(episode.path[-1], episode.path[-2])


@pytest.mark.slow
class TestCompiledRolloutsEqualTheReference:
    @pytest.mark.parametrize("name", ["paper", "paper_flange", "lrmate200ic_5l"])
    def test_random_linear_policies(self, simulators, name):
        simulator = simulators[name]
        ends = compare_networks(simulator, random_networks(simulator, 100, 1), 2, 500)
        assert 50 < ends[1] < 490

    @pytest.mark.parametrize("name", ["paper", "lrmate200ic_5l"])
    def test_random_deep_policies(self, simulators, name):
        simulator = simulators[name]
        networks = random_networks(simulator, 50, 3, hidden=(16, 12))
        ends = compare_networks(simulator, networks, 4, 300)
        assert ends[1] > 20

    def test_trained_policies(self, long_reach):
        # Closed loops amplify the rounding in which the two evaluations of a network differ.
        ends = compare_networks(long_reach, trained_networks(20, 5), 6, 500, atol=1e-9)
        success, collision, count = ends
        assert success > 100
        assert collision > 20
        assert count - success - collision > 20

    @pytest.mark.parametrize("name", ["paper", "paper_flange", "lrmate200ic_5l"])
    @pytest.mark.parametrize("task_name", ["left", "right"])
    def test_action_tables(self, shipped_arms, name, task_name):
        simulator = Simulator(shipped_arms[name], task_name, threads=1)
        ends = compare_actions(simulator, 7, 250)
        assert ends[1] > 15

    @pytest.mark.parametrize("name", ["mesh", "sliding"])
    def test_generic_arms(self, simulators, name):
        simulator = simulators[name]
        ends = compare_actions(simulator, 8, 120)
        ends += compare_networks(simulator, random_networks(simulator, 20, 9), 10, 80)
        assert 10 < ends[1] < 190


def test_short_episodes_of_other_time_steps(shipped_arms):
    simulator = Simulator(
        shipped_arms["paper"], task(horizon=7, tolerance=0.4), time_step=0.1, threads=1
    )
    success, collision, count = compare_actions(simulator, 11, 200, held=3)
    assert collision > 5
    assert success > 1
    assert count > collision + success
