"""Policies of other observations: mirror, files, conversions, trainings, and who may face what."""

from dataclasses import replace

import numpy as np
import pytest

from kinarm import ReachProblem, Simulator
from kinarm.evaluation import evaluate
from kinarm.policies import ARSConfig, Policy, train_policy
from kinarm.policies.mirror import find_mirror, missing_mirror
from kinarm.policies.policy import Layer
from kinarm.policies.provenance import Provenance

PARTS = ["joint_angles", "joint_velocities", "last_action", "proximity", "goal", "goal_minus_tool"]
BOTH = ReachProblem.load("both").replace(
    observation={"parts": [*PARTS, "obstacles", "joint_positions"], "history": 2}
)


@pytest.fixture(scope="module")
def simulator():
    return Simulator(BOTH, threads=1)


@pytest.fixture(scope="module")
def policy(simulator):
    """A linear policy with random weights and a mirror.

    It does not look at obstacles: where both benches are as far, at a limit of the first joint,
    rounding decides which one comes first.
    """
    rng, shape = np.random.default_rng(0), (simulator.n_actions, simulator.n_observations)
    weights, layout = rng.normal(size=shape) / 10, simulator.world.layout
    weights.reshape(5, 2, layout.width)[..., layout.places["obstacles"]] = 0.0
    return Policy(
        mean=np.zeros(shape[1]),
        std=np.ones(shape[1]),
        layers=(Layer(weights, np.zeros(shape[0])),),
        provenance=Provenance(algorithm="a", recipe="b", problem=BOTH.pinned, environment_steps=0),
        mirror=find_mirror(simulator.world),
    )


class TestMirror:
    def test_images_differ_by_signs(self, simulator):
        mirror = find_mirror(simulator.world)
        starts, goals = simulator.sample(np.random.default_rng(0), 50)
        axes = np.append(mirror.actions, -1.0)
        seen = simulator.world.observe(starts, goals)
        image = simulator.world.observe(starts * axes, goals * [1, -1, 1])
        np.testing.assert_allclose(image, seen * mirror.observations, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(seen[:, mirror.side] > 0, goals[:, 1] > 0)

    def test_episodes_are_mirror_images(self, simulator, policy):
        starts, goals = simulator.sample(np.random.default_rng(1), 40)
        axes = np.append(policy.mirror.actions, -1.0)
        here = simulator.rollout(policy, starts, goals)
        there = simulator.rollout(policy, starts * axes, goals * [1, -1, 1])
        np.testing.assert_array_equal(here.steps, there.steps)
        np.testing.assert_allclose(here.distance, there.distance, rtol=0, atol=1e-9)
        called = simulator.rollout(lambda seen: policy(seen), starts, goals)
        np.testing.assert_allclose(here.distance, called.distance, rtol=0, atol=1e-9)

    def test_needs_the_goal(self):
        unseen = BOTH.replace(observation=["goal_minus_tool", "joint_positions"])
        assert missing_mirror(unseen) == "the observation has no part 'goal', which tells the side"


class TestFile:
    def test_round_trip(self, policy, simulator, tmp_path):
        policy.save(tmp_path / "a.npz")
        loaded = Policy.load(tmp_path / "a.npz")
        assert loaded.problem == policy.problem
        assert loaded.mirror.side == policy.mirror.side == simulator.world.layout.side > 1
        scenarios = simulator.sample(np.random.default_rng(2), 20)
        first, second = (simulator.rollout(each, *scenarios) for each in (policy, loaded))
        np.testing.assert_array_equal(first.distance, second.distance)

    def test_dictionaries_of_goals(self, policy, simulator):
        once = BOTH.replace(observation={"history": 1})
        shorter = replace(
            policy,
            provenance=replace(policy.provenance, problem=once.pinned),
            **{name: getattr(policy, name)[: len(policy.mean) // 2] for name in ("mean", "std")},
            layers=(Layer(policy.layers[0].weights[:, : len(policy.mean) // 2], np.zeros(5)),),
            mirror=None,
        )
        from kinarm import ReachGoalEnv

        env = ReachGoalEnv(once)
        shown, flat = env.reset(seed=3)[0], env.episodes.observation
        np.testing.assert_allclose(shorter.predict(shown)[0], shorter(flat)[0], atol=1e-12)
        with pytest.raises(Exception, match="or a history needs a flat observation"):
            policy.predict(shown)


class TestEvaluation:
    def test_a_policy_sees_its_list_in_any_problem(self, policy):
        own = evaluate(policy, trials=4)
        other = evaluate(policy, "both", trials=4)
        assert (own.rollouts.configurations == other.rollouts.configurations).all()

    def test_a_policy_keeps_to_its_kind_of_goals(self, policy):
        seen = ["joint_angles", "goal_rotation"]
        turned = ReachProblem.load("both").replace(goal={"kind": "direction"}, observation=seen)
        made = replace(policy.provenance, problem=turned)
        with pytest.raises(Exception, match="cannot have 'goal_rotation'"):
            evaluate(replace(policy, provenance=made), "both", trials=4)


def test_a_training_with_another_list_improves():
    parts = ["goal", "goal_minus_tool", "joint_angles", "last_action", "obstacles"]
    problem = ReachProblem.load("right").replace(observation=parts, tolerance=0.2, start_spread=0.2)
    states = []
    config = ARSConfig(problem=problem, iterations=60, seed=1, episodes=4)
    trained = train_policy(config, on_iteration=states.append).policy
    assert trained.n_observations == 3 + 3 + 12 + 5 + 48
    simulator = Simulator(problem, threads=1)
    scenarios = simulator.sample(np.random.default_rng(9), 300)
    still = replace(trained, layers=(Layer(0 * trained.layers[0].weights, np.zeros(5)),))
    before, after = (simulator.rollout(each, *scenarios) for each in (still, trained))
    assert after.returns.mean() > before.returns.mean() + 0.1
    assert after.success.mean() > before.success.mean() + 0.2
