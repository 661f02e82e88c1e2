"""Augmented Random Search: the update by hand, its known traps, and exact resuming."""

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from kinarm.errors import InvalidInputError
from kinarm.failed_scenarios import FailedScenarios
from kinarm.policies import ARSConfig, state_policy, train_policy
from kinarm.policies.ars.algorithm import (
    ARSTraining,
    Scenarios,
    ars_step,
    perturbed_policies,
    top_directions,
)
from kinarm.policies.ars.networks import perturbations
from kinarm.policies.checkpoint import load_checkpoint, save_checkpoint
from kinarm.policies.mirror import problem_mirror
from kinarm.policies.normalizer import Normalizer
from kinarm.problem import PROBLEMS
from kinarm.task import RewardWeights
from tests.helpers.reference import ReferenceSimulator

SHORT = PROBLEMS["right"].replace(horizon=8, tested_configurations=4)
TINY = ARSConfig(problem=SHORT, directions=4, top_directions=2, iterations=6, seed=5)


@pytest.fixture(scope="module")
def tiny_simulator():
    return TINY.simulator(threads=1)


def random_round(seed, directions=6):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(directions, 5, 48)), rng.normal(size=(2, directions))


def iterate(config, simulator, state):
    """One iteration, in a simulator that is there already."""
    training = ARSTraining(config, threads=1)
    training.simulator = simulator
    return training.iterate(state)


def run(config, simulator, iterations, state=None):
    states = [state or ARSTraining(config, threads=1).initial_state()]
    for _ in range(iterations):
        states.append(iterate(config, simulator, states[-1]))
    return states


def assert_same_state(first, second):
    assert first.theta.tobytes() == second.theta.tobytes()
    assert first.normalizer.count == second.normalizer.count
    assert first.normalizer.mean.tobytes() == second.normalizer.mean.tobytes()
    assert first.normalizer.squares.tobytes() == second.normalizer.squares.tobytes()
    assert first.generator == second.generator
    assert [point[:4] for point in first.curve] == [point[:4] for point in second.curve]


def assert_same_policy(first, second):
    pairs = zip(
        (first.mean, first.std, *first.layers[0]),
        (second.mean, second.std, *second.layers[0]),
        strict=True,
    )
    assert all(a.tobytes() == b.tobytes() for a, b in pairs)
    assert first.provenance.environment_steps == second.provenance.environment_steps


class TestStep:
    @pytest.mark.parametrize("b", [1, 3, 6])
    def test_equals_algorithm_1(self, b):
        config = ARSConfig(directions=6, top_directions=b)
        delta, returns = random_round(b)
        best = sorted(range(6), key=lambda k: -max(returns[0, k], returns[1, k]))[:b]
        total = sum((returns[0, k] - returns[1, k]) * delta[k] for k in best)
        expected = 0.02 / (b * np.std(returns, ddof=0)) * total
        np.testing.assert_allclose(ars_step(config, delta, returns, 0.02), expected, rtol=1e-12)

    def test_basic_random_search_is_equations_2_and_3(self):
        config = ARSConfig(directions=6, top_directions=6, scale_by_deviation=False)
        delta, returns = random_round(7)
        gradient = np.mean([(returns[0, n] - returns[1, n]) * delta[n] for n in range(6)], axis=0)
        np.testing.assert_allclose(ars_step(config, delta, returns, 0.1), 0.1 * gradient)

    @pytest.mark.parametrize("value", [0.0, 3.7, -1e3])
    def test_tied_returns_move_nothing(self, value):
        config = ARSConfig(directions=6, top_directions=3)
        delta, _ = random_round(8)
        step = ars_step(config, delta, np.full((2, 6), value), 0.02)
        np.testing.assert_array_equal(step, np.zeros((5, 48)))


def test_exactly_b_directions_with_ties_in_their_order():
    returns = np.array([[1, 2, 1, 2, 1, 0.0], [0, 0, 1, 2, 0, 1]])
    np.testing.assert_array_equal(top_directions(returns, 3), [1, 3, 0])
    np.testing.assert_array_equal(top_directions(returns, 4), [1, 3, 0, 2])


class TestPolicies:
    def test_are_theta_times_the_normalised_observation(self):
        rng = np.random.default_rng(10)
        theta, step = rng.normal(size=(5, 48)), rng.normal(size=(3, 5, 48))
        data = rng.normal(size=(1000, 48)) * rng.uniform(0.1, 2, 48) + rng.normal(size=48)
        data[:, :2] = 0.325
        normalizer = Normalizer(1000, data.mean(axis=0), 1000 * data.var(axis=0))
        networks = perturbed_policies(theta, step, normalizer)
        seen = rng.normal(size=48)
        scaled = (seen - data.mean(axis=0))[2:] / data.std(axis=0)[2:]
        for k, perturbed in enumerate([*(theta + step), *(theta - step)]):
            action = networks.layers[0].weights[k] @ seen + networks.layers[0].bias[k]
            np.testing.assert_allclose(action, perturbed[:, 2:] @ scaled, rtol=1e-10)

    def test_without_normaliser_are_theta_itself(self):
        theta, step = np.random.default_rng(11).normal(size=(2, 5, 48))
        (layer,) = perturbed_policies(theta, step[None], Normalizer.empty(48)).layers
        np.testing.assert_array_equal(layer.bias, 0)
        np.testing.assert_array_equal(layer.weights[1], theta - step)


def drawn(config, simulator, rng):
    """Scenarios of an iteration before any was failed."""
    training = ARSTraining(config, threads=1)
    training.simulator = simulator
    return training.draw_shared(rng, FailedScenarios.none(simulator.arm.n_joints))


class TestIteration:
    @pytest.mark.parametrize("normalize", [True, False])
    @pytest.mark.parametrize("sharing", ["none", "iteration"])
    def test_by_hand_with_the_reference_simulator(self, normalize, sharing):
        config = replace(TINY, normalize=normalize, sharing=sharing, episodes=2)
        simulator = config.simulator(threads=1)
        reference = ReferenceSimulator(simulator)
        state = run(config, simulator, 2)[-1]
        after = iterate(config, simulator, state)

        rng = np.random.default_rng()
        rng.bit_generator.state = state.generator
        delta = perturbations(rng, (4, 5, 48))
        starts, goals = drawn(config, simulator, rng).of_all_episodes
        mean, std = state.normalizer.mean, state.normalizer.std
        scale = np.where(std < 1e-6, 0, 1 / np.where(std < 1e-6, 1, std))
        if not normalize:
            mean, scale = np.zeros(48), np.ones(48)
        returns, seen, row = np.zeros((2, 4)), [], 0
        for sign in (0, 1):
            for k in range(4):
                theta = state.theta + (0.03, -0.03)[sign] * delta[k]
                for _ in range(2):
                    episode = reference.rollout(
                        lambda x, theta=theta: theta @ (scale * (x - mean)), starts[row], goals[row]
                    )
                    returns[sign, k] += episode.rewards.sum() / 2
                    seen.append(episode.observations[:-1])
                    row += 1
        expected = state.theta + ars_step(config, delta, returns, config.step_size)
        np.testing.assert_allclose(after.theta, expected, rtol=0, atol=1e-9)

        seen = np.concatenate(seen)
        assert after.normalizer.count == state.normalizer.count + len(seen)
        old, count = state.normalizer, after.normalizer.count
        combined = (old.count * old.mean + seen.sum(axis=0)) / count
        np.testing.assert_allclose(after.normalizer.mean, combined, atol=1e-12)
        second = old.count * (old.std**2 + old.mean**2) + (seen**2).sum(axis=0)
        variance = np.maximum(second / count - combined**2, 0)
        np.testing.assert_allclose(after.normalizer.std**2, variance, atol=1e-10)


class TestScenarios:
    @pytest.mark.parametrize(
        ("sharing", "different"), [("none", 24), ("pair", 12), ("iteration", 3)]
    )
    def test_are_shared(self, tiny_simulator, sharing, different):
        config = replace(TINY, sharing=sharing, episodes=3)
        scenarios = drawn(config, tiny_simulator, np.random.default_rng(12))
        table = np.concatenate(scenarios.of_all_episodes, axis=1).reshape(2, 4, 3, 9)
        assert len(np.unique(table.reshape(-1, 9), axis=0)) == different
        if sharing == "pair":
            np.testing.assert_array_equal(table[0], table[1])
        if sharing == "iteration":
            assert (table == table[:1, :1]).all()

    def test_with_a_mirror_all_goals_lie_on_the_right(self):
        """What was drawn on the right is as drawn; the rest is its image, free of contact, too."""
        config = replace(TINY, problem="both", symmetric=True, episodes=20)
        simulator = config.simulator(threads=1)
        rngs = [np.random.default_rng(14) for _ in range(2)]
        plain = drawn(replace(config, symmetric=False), simulator, rngs[0])
        folded = drawn(config, simulator, rngs[1])
        left = plain.goals[:, 1] > 0
        assert 0.3 < left.mean() < 0.7
        np.testing.assert_array_equal(folded.goals[:, 1], -np.abs(plain.goals[:, 1]))
        np.testing.assert_array_equal(folded.starts[~left], plain.starts[~left])
        signs = [-1, 1, 1, -1, 1, 1]  # the last joint is held
        np.testing.assert_array_equal(folded.starts[left], plain.starts[left] * signs)
        assert not simulator.world.screen(folded.starts)[1].any()

    def test_failed_ones_are_kept_and_come_again(self, tiny_simulator):
        config = replace(TINY, sharing="iteration", episodes=30, replay_share=0.5, replay_size=20)
        states = run(config, tiny_simulator, 6)
        met = [set(map(tuple, state.failed.goals)) for state in states]
        assert [len(state.failed.goals) for state in states][:: len(states) - 1] == [0, 20]
        assert sum(len(before & after) for before, after in pairwise(met)) > 5
        for state in states[1:]:
            assert not tiny_simulator.world.screen(state.failed.starts)[1].any()

    def test_what_at_least_half_of_the_policies_miss_counts_as_failed(self):
        starts, goals = np.arange(12.0).reshape(2, 6), np.arange(6.0).reshape(2, 3)
        scenarios = Scenarios(starts, goals, np.zeros(2, dtype=bool), copies=4)
        for reached, kept in (((2, 3), [0]), ((3, 4), []), ((0, 1), [0, 1])):
            success = np.arange(4)[:, None] < reached
            rollouts = SimpleNamespace(success=success.reshape(-1))
            np.testing.assert_array_equal(scenarios.missed(rollouts)[1], goals[kept])

    def test_the_curve_leaves_replayed_ones_out(self):
        scenarios = Scenarios(np.zeros((3, 6)), np.zeros((3, 3)), np.array([0, 1, 0], bool), 2)
        rollouts = SimpleNamespace(
            returns=np.array([1.0, 9, 3, 5, 9, 7]), success=np.array([1, 0, 0, 1, 0, 1], bool)
        )
        assert scenarios.outcome_of_new(rollouts) == (4.0, np.sqrt(5.0), 0.75)
        replayed = scenarios._replace(replayed=np.ones(3, dtype=bool))
        assert np.isnan(replayed.outcome_of_new(rollouts)).all()


class TestTraining:
    def test_threads_do_not_matter(self):
        config = replace(TINY, directions=24, problem=PROBLEMS["right"], iterations=4)
        assert_same_policy(
            train_policy(config, threads=1).policy, train_policy(config, threads=2).policy
        )

    def test_equals_its_iterations(self, tiny_simulator):
        states, seen = run(TINY, tiny_simulator, TINY.iterations), []
        result = train_policy(TINY, on_iteration=seen.append)
        assert [state.iteration for state in seen] == [1, 2, 3, 4, 5, 6]
        assert_same_state(seen[-1], states[-1])
        assert result.curve[-1].environment_steps == states[-1].normalizer.count
        assert all(np.isfinite(point).all() and point.std_return > 0 for point in result.curve)

    def test_policy_behaves_like_the_last_parameters(self, tiny_simulator):
        state = run(TINY, tiny_simulator, 3)[-1]
        policy = state_policy(TINY, state)
        still = np.zeros((1, *state.theta.shape))
        trained = perturbed_policies(state.theta, still, state.normalizer)
        np.testing.assert_allclose(
            policy.networks().parameters, trained.parameters[:1], rtol=1e-12, atol=1e-15
        )

    def test_constant_inputs_of_the_training_have_weight_zero(self):
        # On one bench the height of the goal never changes, nor does the place of axis 1.
        policy = train_policy(TINY).policy
        weights = policy.networks().layers[0].weights[0]
        np.testing.assert_array_equal(weights[:, [2, 30, 31, 32]], 0)
        assert (weights[:, [0, 1, 3]] != 0).all()

    def test_linear_schedule_falls_to_zero(self):
        config = ARSConfig(step_size=0.4, step_size_schedule="linear", iterations=4)
        assert [config.step_size_at(k) for k in range(5)] == pytest.approx([0.4, 0.3, 0.2, 0.1, 0])
        assert ARSConfig(step_size=0.4).step_size_at(700) == 0.4

    @pytest.mark.slow
    @pytest.mark.parametrize(
        "settings", [{}, {"step_size_schedule": "linear", "reward": RewardWeights(success=0.5)}]
    )
    def test_short_training_beats_standing_still_by_far(self, settings):
        """In half of six seeds at least: about one in three stops short of the goals."""
        simulator = ARSConfig().simulator()
        starts, goals = simulator.sample(np.random.default_rng(14), 1000)
        idle = simulator.rollout(lambda seen: np.zeros((len(seen), 5)), starts, goals)
        assert not idle.success.any()
        good = 0
        for seed in range(6):
            config = ARSConfig(
                sharing="iteration", episodes=2, iterations=300, step_size=0.05, seed=seed
            )
            policy = train_policy(replace(config, **settings)).policy
            trained = simulator.rollout(policy, starts, goals)
            good += (
                np.median(trained.distance) < 0.4 * np.median(idle.distance)
                and trained.returns.mean() > idle.returns.mean() + 0.2
                and trained.success.mean() > 0.04
            )
        assert good >= 3


@pytest.mark.parametrize("stop", [1, 3, 6])
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"sharing": "pair", "step_size_schedule": "linear", "episodes": 2, "problem": "both"},
        {"replay_share": 0.5, "replay_size": 40, "episodes": 2},
    ],
)
def test_resumed_training_equals_an_uninterrupted_one(tmp_path, stop, changes):
    config, seen = replace(TINY, **changes), []
    whole = train_policy(config, on_iteration=seen.append)
    save_checkpoint(tmp_path / "run.ckpt", config, seen[stop - 1])
    loaded, state = load_checkpoint(tmp_path / "run.ckpt")
    assert (loaded, state.iteration) == (config, stop)
    rest = []
    resumed = train_policy(loaded, state=state, on_iteration=rest.append)
    assert len(rest) == 6 - stop
    assert_same_state(resumed.state, seen[-1])
    assert_same_policy(resumed.policy, whole.policy)
    assert len(seen[-1].failed.goals) == config.replay_size if config.replay_share else True


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"directions": 0}, "directions must be a whole number of at least 1, got 0"),
        ({"top_directions": 25}, r"top_directions must be at most directions \(24\), got 25"),
        ({"step_size": 0}, "step_size must be greater than 0, got 0"),
        ({"sharing": "all"}, "sharing must be one of none, pair, iteration, got 'all'"),
    ],
)
def test_impossible_settings_are_refused(settings, message):
    with pytest.raises(InvalidInputError, match=message):
        ARSConfig(**settings)


def test_later_goals_are_met_as_the_policy_meets_them(monkeypatch):
    """Also on the left, where the policy sees them reflected."""
    problem = PROBLEMS["both"].replace(goal={"sequence": 3}, tolerance=0.2)
    changes = {"initial_policy": "ars-linear-both-seed0", "noise": 1e-9, "episodes": 8}
    config = replace(TINY, problem=problem, symmetric=True, **changes)
    training = ARSTraining(config, threads=1)
    state = training.initial_state()
    rollout, met = training.simulator.rollout, []

    def watched(policies, *scenarios, **others):
        met.append((scenarios, rollout(policies, *scenarios, **others).returns))
        return rollout(policies, *scenarios, **others)

    monkeypatch.setattr(training.simulator, "rollout", watched)
    training.iterate(state)
    ((scenarios, returns),) = met
    expected = rollout(state_policy(config, state), *scenarios)
    assert (expected.goals_reached > 0).sum() > 5
    np.testing.assert_allclose(returns, expected.returns, atol=1e-3)


def test_policies_at_any_time_of_a_training_have_the_mirror():
    config, states = replace(TINY, problem="both", symmetric=True), []
    train_policy(config, on_iteration=states.append)
    mirror = problem_mirror(config.problem)
    for state in states:
        policy = state_policy(config, state)
        np.testing.assert_array_equal(policy.mirror.observations, mirror.observations)
        np.testing.assert_array_equal(policy.mirror.actions, mirror.actions)
