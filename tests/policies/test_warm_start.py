"""Trainings that begin with a policy do at first what the policy does."""

from dataclasses import replace

import numpy as np
import pytest

from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.policies import ARSConfig, PPOConfig, load_policy, state_policy, train_policy
from kinarm.policies.learners import training_states
from kinarm.policies.policy import Layer
from kinarm.problem import PROBLEMS
from kinarm.simulator import Simulator


def first_policy(config):
    """What a training takes for its policy before the first iteration."""
    return state_policy(config, next(training_states(config)))


@pytest.fixture
def network_file(tmp_path, make_policy):
    path = tmp_path / "network.npz"
    make_policy(9, seed=3).save(path)
    return str(path)


def same_deeds(first, second, problem="left"):
    simulator = Simulator(problem, threads=1)
    starts, goals = simulator.sample(np.random.default_rng(6), 60)
    found, expected = (
        simulator.rollout(replace(policy, mirror=None), starts, goals, record=True)
        for policy in (first, second)
    )
    np.testing.assert_array_equal(found.steps, expected.steps)
    np.testing.assert_allclose(found.paths, expected.paths, rtol=0, atol=1e-4)


def test_ars_begins_with_a_linear_policy():
    config = ARSConfig(problem="left", initial_policy="ars-tuned-both-seed1")
    same_deeds(first_policy(config), load_policy("ars-tuned-both-seed1"))


def test_ars_begins_with_a_network(network_file):
    config = ARSConfig(problem="left", initial_policy=network_file, net_arch=(9,))
    same_deeds(first_policy(config), load_policy(network_file))


def test_ppo_begins_with_an_actor():
    name = "ppo-paper-both-seed2"
    config = PPOConfig(problem="left", initial_policy=name)
    same_deeds(first_policy(config), load_policy(name))


def test_another_arm_will_do():
    config = ARSConfig(
        problem=PROBLEMS["right"].replace(arm="lrmate200ic_5l"),
        initial_policy="ars-tuned-both-seed1",
        iterations=1,
    )
    weights = load_policy("ars-tuned-both-seed1").layers[0].weights
    np.testing.assert_array_equal(first_policy(config).layers[0].weights, weights)


def test_others_are_refused(tmp_path, network_file):
    with pytest.raises(UnknownNameError, match="nothing-like-it"):
        first_policy(ARSConfig(initial_policy="nothing-like-it"))
    adding = load_policy("ppo-best-both-seed0")
    settings = {"initial_policy": "ppo-best-both-seed0", "net_arch": (64, 64, 64)}
    with pytest.raises(InvalidInputError, match=r"; residual\), the training .*linear\)$"):
        first_policy(PPOConfig(problem=adding.problem, **settings))
    same_deeds(first_policy(PPOConfig(problem="left", residual=True, **settings)), adding)
    message = r"'.*network.npz' has layers 48-9-5 \(tanh, linear\), the training 48-5 \(linear\)"
    with pytest.raises(InvalidInputError, match=message):
        first_policy(ARSConfig(initial_policy=network_file))
    relu = replace(load_policy(network_file), activations=("relu", "linear"))
    relu.save(tmp_path / "relu.npz")
    with pytest.raises(
        InvalidInputError, match=r"9-5 \(relu, linear\), .* 48-9-5 \(tanh, linear\)"
    ):
        first_policy(ARSConfig(initial_policy=str(tmp_path / "relu.npz"), net_arch=(9,)))
    linear = load_policy("ars-tuned-both-seed1")
    biased = replace(linear, layers=(Layer(linear.layers[0].weights, np.ones(5)),))
    biased.save(tmp_path / "biased.npz")
    with pytest.raises(InvalidInputError, match="has a bias"):
        first_policy(ARSConfig(initial_policy=str(tmp_path / "biased.npz")))


def test_a_policy_that_normalises_is_refused_where_none_does(tmp_path):
    policy = load_policy("ars-tuned-both-seed1")
    with pytest.raises(InvalidInputError, match="normalises observations"):
        first_policy(ARSConfig(initial_policy="ars-tuned-both-seed1", normalize=False))
    plain = replace(policy, mean=np.zeros(48), std=np.ones(48))
    plain.save(tmp_path / "plain.npz")
    config = ARSConfig(initial_policy=str(tmp_path / "plain.npz"), normalize=False)
    same_deeds(first_policy(config), plain)


def test_a_policy_that_sees_something_else_is_refused(tmp_path):
    """Even if its observation is as long."""
    parts = ("goal", "goal_minus_tool", "joint_positions")
    problems = [
        PROBLEMS["right"].replace(observation=[*parts, last])
        for last in ("last_action", "joint_velocities")
    ]
    config = ARSConfig(problem=problems[0], initial_policy=str(tmp_path / "a.npz"))
    first_policy(replace(config, initial_policy=None)).save(tmp_path / "a.npz")
    assert first_policy(config).n_observations == 17
    with pytest.raises(InvalidInputError, match=r"sees 1: .*last_action 1a, the training 1: .*joi"):
        first_policy(replace(config, problem=problems[1]))


def test_steps_are_those_of_the_training():
    """Not the observations that the initial policy's statistics stand for."""
    settings = {"iterations": 2, "directions": 2, "top_directions": 1}
    warm = ARSConfig(initial_policy="ars-tuned-both-seed1", **settings)
    for config in (ARSConfig(**settings), warm):
        curve = train_policy(config, threads=1).curve
        taken = [point.environment_steps for point in curve]
        assert 0 < taken[0] < taken[1] <= 2 * 4 * 64
