"""Imitation of the oracle, held against NumPy, the simulator and an actor that learnt nothing."""

from dataclasses import replace

import numpy as np
import pytest

from kinarm._console import told_of_activities
from kinarm.policies import Oracle, PPOConfig
from kinarm.policies.normalizer import Normalizer
from kinarm.policies.ppo.kernels.update import LOSSES, Experience, Objective, add_gradients
from kinarm.policies.ppo.learner import IMITATING, PPOTraining
from kinarm.policies.ppo.networks import ActorCritic, actor_policy, initial_parameters
from kinarm.policies.ppo.update import BATCH_SIZE, imitate
from kinarm.problem import PROBLEMS

WIDTHS = (7, 9, 5, 3)
RIGHT = PROBLEMS["right"]


def made_networks(seed=0):
    parameters = initial_parameters(np.random.default_rng(seed), WIDTHS, -1.0)
    networks = ActorCritic(WIDTHS)
    networks.load(parameters)
    return networks, parameters


def made_demonstrations(count=300):
    """Actions that are a smooth function of what is seen."""
    rng = np.random.default_rng(3)
    observations = 2.0 + rng.normal(size=(count, WIDTHS[0]))
    return observations, np.tanh(observations[:, :3] - observations[:, 3:6])


def test_gradient_is_that_of_the_mean_squared_error():
    networks, parameters = made_networks()
    shown = made_demonstrations(150)
    arrays = [array.astype(np.float32) for array in shown]
    experience = Experience(*arrays, *np.empty((4, 0), dtype=np.float32))
    chosen = np.random.default_rng(0).permutation(150)[:101]
    found = []
    for parts in (1, 3):
        gradients = np.full((parts, len(networks.weights)), np.nan, dtype=np.float32)
        losses = np.full((parts, LOSSES), np.nan)
        objective = Objective(0.0, 0.0, 0.0, 1 / (101 * WIDTHS[-1]), imitating=True)
        given = (experience, chosen, objective, (0.0, 1.0), gradients, losses)
        add_gradients(0, parts, networks.actor, networks.critic, *given)
        found.append(networks.gathered(gradients.sum(axis=0)))
    np.testing.assert_allclose(found[0], found[1], rtol=0, atol=1e-6)
    wanted = shown[1][chosen]

    def loss(vector):
        networks.load(vector.astype(np.float32))
        return float(np.mean((networks.means(arrays[0][chosen]).astype(float) - wanted) ** 2))

    assert losses.sum() / wanted.size == pytest.approx(loss(parameters), rel=1e-5)
    rng = np.random.default_rng(1)
    for _ in range(10):
        step = 1e-3 * rng.normal(size=len(parameters))
        change = loss(parameters + step) - loss(parameters - step)
        assert found[0] @ step == pytest.approx(change / 2, rel=0.02, abs=2e-6)


def test_an_actor_learns_what_it_is_shown_and_the_critic_nothing():
    shown, learnt = made_demonstrations(20 * BATCH_SIZE + 7), []
    observations, actions = shown
    normalizer = Normalizer.of(observations)
    for threads in (1, 3):
        networks, _ = made_networks()
        imitate(networks, shown, normalizer, np.random.default_rng(0), threads)
        learnt.append(networks.gathered(networks.weights))
    np.testing.assert_array_equal(learnt[0], learnt[1])
    seen = ((observations - normalizer.mean) / normalizer.std).astype(np.float32)
    before, _ = made_networks()
    errors = [np.mean((each.means(seen) - actions) ** 2) for each in (before, networks)]
    assert errors[1] < 0.25 * errors[0]
    np.testing.assert_array_equal(networks.values(seen, 1), before.values(seen, 1))


def test_a_training_begins_with_what_was_imitated():
    config = PPOConfig(
        problem=RIGHT,
        symmetric=True,
        iterations=1,
        n_envs=4,
        n_steps=8,
        batch_size=16,
        net_arch=(32, 32),
        demonstrations=300,
    )
    fresh = Oracle(RIGHT, threads=1).demonstrations(100)

    def error(config, threads=1):
        state = PPOTraining(config, threads=threads).initial_state()
        actions = actor_policy(config, state)(fresh.observations)
        return np.mean((actions - fresh.actions) ** 2), state.parameters

    heard: list[str] = []
    with told_of_activities(heard.append):
        taught, parameters = error(config)
    assert (heard[0], heard[-1]) == (IMITATING, "")
    assert taught < 0.65 * error(replace(config, demonstrations=0))[0]
    np.testing.assert_array_equal(error(config, threads=2)[1], parameters)
    assert not np.array_equal(error(replace(config, seed=1))[1], parameters)
