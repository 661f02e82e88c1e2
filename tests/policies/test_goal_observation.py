"""Dictionary observations as policies take them, against the environments that make them."""

import numpy as np
import pytest

from kinarm.envs.goal import GoalInterface, ReachGoalEnv
from kinarm.errors import InvalidInputError
from kinarm.policies import load_policy


@pytest.fixture
def shown(simulator):
    """Observations of some arms, flat and as a dictionary, and their layout."""
    flat = simulator.world.observe(*simulator.sample(np.random.default_rng(0), 30))
    return flat, GoalInterface(simulator).observe(flat), simulator.world.layout


def test_is_what_the_environment_split(shown):
    flat, parts, layout = shown
    np.testing.assert_allclose(layout.flat(parts), flat, rtol=0, atol=1e-15)
    one = {name: part[3] for name, part in parts.items()}
    np.testing.assert_allclose(layout.flat(one), flat[3], rtol=0, atol=1e-15)


def test_arms_of_other_joints(any_simulator):
    flat = any_simulator.world.observe(*any_simulator.sample(np.random.default_rng(0), 5))
    parts = GoalInterface(any_simulator).observe(flat)
    layout = any_simulator.world.layout
    np.testing.assert_allclose(layout.flat(parts), flat, rtol=0, atol=1e-15)


def test_what_a_dictionary_lacks_is_not_made_up():
    """Resolved-rate control depends on the goal, and is in none of the entries."""
    policy = load_policy("ppo-best-both-seed0")
    shown, _ = ReachGoalEnv("both", observation=policy.observation).reset(seed=0)
    with pytest.raises(InvalidInputError, match="resolved_rate or a history needs a flat"):
        policy.predict(shown)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mood": [1.0]}, "has the keys observation, achieved_goal, desired_goal, got .*mood"),
        ({"achieved_goal": np.zeros((2, 3))}, r"achieved_goal must have shape \(3\)"),
        ({"observation": np.zeros(48)}, r"observation must have shape \(42\)"),
    ],
)
def test_others_are_refused(shown, change, message):
    one = {name: part[0] for name, part in shown[1].items()}
    with pytest.raises(InvalidInputError, match=message):
        shown[2].flat({**one, **change})
