"""Hindsight replay: what changes with the goal, and what does not."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from stable_baselines3 import SAC
from stable_baselines3.common.vec_env import VecNormalize

from kinarm.policies import sb3_vec_env
from kinarm.policies.sb3.hindsight import HindsightReplayBuffer

TOLERANCE, COLLISION = 0.3, -3.0


def filled(env, steps=400):
    """A learner whose buffer holds random steps of nine arms."""
    settings = {"n_sampled_goal": 4, "goal_selection_strategy": "future"}
    model = SAC(
        *("MultiInputPolicy", env),
        replay_buffer_class=HindsightReplayBuffer,
        replay_buffer_kwargs=settings,
        learning_starts=10_000,
        buffer_size=9000,
        seed=1,
    )
    model.learn(9 * steps)
    return model


@pytest.fixture(scope="module")
def samples():
    env = sb3_vec_env(
        "right", 9, goal_conditioned=True, tolerance=TOLERANCE, reward={"collision": COLLISION}
    )
    return filled(env).replay_buffer.sample(4000)


def apart(samples):
    goals = samples.next_observations
    return np.linalg.norm((goals["achieved_goal"] - goals["desired_goal"]).numpy(), axis=1)


def test_an_episode_ends_where_the_goal_is_reached_and_nowhere_else(samples):
    reached = apart(samples) <= TOLERANCE
    assert 100 < reached.sum() < 3900
    np.testing.assert_array_equal(samples.dones[:, 0] > 0, reached)


def test_rewards_are_those_of_the_goals_and_of_collisions(samples):
    stayed = [
        (samples.observations[key] == samples.next_observations[key]).all(dim=1).numpy()
        for key in ("observation", "achieved_goal")
    ]
    refused = np.logical_and(*stayed)
    assert refused.sum() > 20
    expected = np.where(apart(samples) <= TOLERANCE, 0.0, -1.0) + COLLISION * refused
    np.testing.assert_allclose(samples.rewards[:, 0], expected, atol=1e-5)


def test_goals_are_judged_as_they_are_and_not_as_they_are_shown():
    arms = sb3_vec_env("right", 9, goal_conditioned=True, tolerance=TOLERANCE)
    env = VecNormalize(arms, clip_obs=1e9)  # all goals are equally high: others would be clipped
    model = filled(env)
    samples = model.replay_buffer.sample(2000, env)
    spread = [np.sqrt(env.obs_rms[key].var + 1e-8) for key in ("achieved_goal", "desired_goal")]
    shown = [samples.next_observations[key].numpy() for key in ("achieved_goal", "desired_goal")]
    means = [env.obs_rms[key].mean for key in ("achieved_goal", "desired_goal")]
    achieved, desired = (s * x + m for s, x, m in zip(spread, shown, means, strict=True))
    distance = np.linalg.norm(achieved - desired, axis=1)
    clear = np.abs(distance - TOLERANCE) > 1e-3
    np.testing.assert_array_equal(samples.dones[clear, 0] > 0, distance[clear] <= TOLERANCE)
