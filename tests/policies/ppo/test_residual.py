"""Residual policies: networks that add to resolved-rate control."""

from dataclasses import replace

import numpy as np
import pytest
from random_policies import policy_for

from kinarm import ReachProblem, Simulator
from kinarm.errors import InvalidInputError
from kinarm.policies import PPOConfig, recipe
from kinarm.policies.learners import state_policy, training_states
from kinarm.policies.mirror import problem_mirror
from kinarm.policies.policy import Layer
from kinarm.policies.ppo.learner import PPOTraining

BOTH = ReachProblem.load("both")
SHOWN = (*BOTH.observation.names("position"), "resolved_rate")
PROBLEM = BOTH.replace(observation=SHOWN)
NEAR = BOTH.replace(observation=(*SHOWN, "proximity"))
RATES = slice(-5, None)
N = 300


@pytest.fixture(scope="module")
def simulator():
    return Simulator(PROBLEM, threads=1)


@pytest.fixture(scope="module")
def near():
    return Simulator(NEAR, threads=1)


def links_of(simulator, observations):
    """Distances of links from bodies [m], and what joints add to them."""
    seen = observations[:, simulator.world.layout.places["proximity"]]
    links = seen.reshape(len(seen), simulator.arm.n_joints, -1)
    return links[..., 0], links[..., 4:]


def test_links_take_at_most_half_of_their_distance_from_bodies(near):
    scenarios = near.sample(np.random.default_rng(5), 2000)
    seen = near.world.observe(*scenarios)
    before, slopes = links_of(near, seen)
    wanted = np.random.default_rng(6).choice([-1.0, 1.0], (2000, near.n_actions))
    turned, shares = wanted.copy(), []
    near.world.layout.turn_away(seen, turned)
    added = np.einsum("elk,ek->el", slopes, turned)
    assert (added > 0.5 * (0.005 - before) - 1e-3).mean() > 0.99
    kept = (np.einsum("elk,ek->el", slopes, wanted) >= 0.5 * (0.005 - before)).all(axis=1)
    np.testing.assert_array_equal((turned == wanted).all(axis=1), kept)
    for actions in (wanted, turned):
        episodes = near.reset(*scenarios)
        moved = ~near.step(episodes, actions).collision
        after, _ = links_of(near, episodes.observation)
        shares.append((after < 0.45 * before)[moved].mean())
    assert shares[0] > 0.005
    assert shares[1] < shares[0] / 3


@pytest.mark.parametrize("mirrored", [False, True])
def test_the_nearer_the_goal_the_less_is_added(simulator, mirrored):
    plain = policy_for(PROBLEM, mirror=problem_mirror(PROBLEM) if mirrored else None)
    policy = replace(plain, residual=True)
    starts, goals = simulator.sample(np.random.default_rng(1), N)
    goals[: N // 2] = simulator.world.reached(starts[: N // 2]) + 0.01
    seen = simulator.world.observe(starts, goals)
    rates = seen[:, RATES]
    longest = np.abs(rates).max(axis=1, keepdims=True)
    assert np.median(longest[: N // 2]) < 0.5
    assert (longest > 0.99).any()
    last = plain.layers[-1]
    small = replace(plain, layers=(*plain.layers[:-1], Layer(last.weights / 99, last.bias / 99)))
    expected = np.clip(rates + longest * 99 * small(seen), -1, 1)
    np.testing.assert_allclose(policy(seen), expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("problem", [PROBLEM, NEAR], ids=["blind", "near"])
def test_kernels_act_as_policies_do(request, problem, mirrored):
    simulator = request.getfixturevalue("near" if problem is NEAR else "simulator")
    mirror = problem_mirror(problem) if mirrored else None
    policy = replace(policy_for(problem, mirror=mirror), residual=True)
    scenarios = simulator.sample(np.random.default_rng(2), N)
    compiled = simulator.rollout(policy, *scenarios, record=True)
    stepped = simulator.rollout(lambda seen: policy(seen), *scenarios, record=True)
    np.testing.assert_array_equal(compiled.steps, stepped.steps)
    np.testing.assert_allclose(compiled.paths, stepped.paths, rtol=0, atol=1e-10)


def test_files_and_shields_keep_it(simulator, tmp_path):
    policy = replace(policy_for(PROBLEM), residual=True).shielded()
    policy.save(tmp_path / "policy.npz")
    again = type(policy).load(tmp_path / "policy.npz")
    assert (again.residual, again.shield) == (True, True)
    seen = simulator.world.observe(*simulator.sample(np.random.default_rng(3), N))
    np.testing.assert_array_equal(again(seen), policy(seen))


def test_without_rates_there_is_nothing_to_add_to():
    with pytest.raises(InvalidInputError, match="needs to see 'resolved_rate'"):
        replace(policy_for(BOTH), residual=True)


@pytest.mark.parametrize("problem", ["both", NEAR], ids=["blind", "near"])
def test_learners_show_the_rates_and_add_to_them(problem):
    """Without noise, the arms of a training move as those of its policy."""
    config = PPOConfig(
        problem=problem, residual=True, n_envs=8, n_steps=5, batch_size=40, net_arch=(6,),
        iterations=1, log_std_init=-30.0, symmetric=True,
    )  # fmt: skip
    assert {*SHOWN}.issubset(config.problem.observation.parts)
    training = PPOTraining(config)
    state = training.initial_state()
    policy = state_policy(config, state)
    arms = training.arms
    training.networks.load(state.parameters)
    arms.restore(state, np.random.default_rng(0))
    q, goals = arms.episodes.q.copy(), arms.episodes.goal.copy()
    training.collect(np.random.default_rng(0))
    expected = arms.simulator.rollout(policy, q, goals, record=True).paths[:, 5]
    going = arms.episodes.steps == 5
    assert going.sum() > 4
    np.testing.assert_allclose(arms.episodes.q[going], expected[going], rtol=0, atol=1e-5)


def test_goals_are_met_closely_before_anything_is_learnt():
    """Half of all goals within a millimetre: what a network has to learn is the way around."""
    config = recipe("ppo", "best", problem="both", iterations=1)
    state = next(iter(training_states(config, None)))
    policy = state_policy(config, state)
    simulator = Simulator(PROBLEM, threads=1).changed(tolerance=0.001).shielded()
    rollouts = simulator.rollout(policy, *simulator.sample(np.random.default_rng(4), N))
    assert 0.4 < rollouts.success.mean() < 0.9
