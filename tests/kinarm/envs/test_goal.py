"""The goal-conditioned environments: the convention of Gymnasium-Robotics, and consistency."""

import gymnasium
import numpy as np
import pytest

from kinarm.envs.goal import ReachGoalEnv, ReachGoalVectorEnv
from kinarm.envs.reach import ReachEnv
from kinarm.kernels.plant import COMMAND

NAMES = [f"kinarm/ReachGoal{task}-v0" for task in ("Left", "Right", "Both")]
HOME = np.zeros(6)
DOWN = {"start": HOME, "goal": [0, 5, 5]}


def episodes(env, steps=300, seed=0):
    """Observations, rewards, flags and infos of random steps."""
    env.reset(seed=seed)
    env.action_space.seed(seed)
    for _ in range(steps):
        result = env.step(np.sign(env.action_space.sample()))
        yield result
        if result[2] or result[3]:
            env.reset()


@pytest.mark.parametrize("name", NAMES)
def test_reward_and_endings_follow_from_the_goals(name):
    env = gymnasium.make(name, tolerance=0.6).unwrapped
    ends = 0
    for observation, reward, terminated, _, info in episodes(env, 1500):
        goals = observation["achieved_goal"], observation["desired_goal"], info
        assert env.compute_reward(*goals) == reward
        assert env.compute_terminated(*goals) == terminated == info["is_success"]
        assert not env.compute_truncated(*goals)
        ends += terminated
    assert ends > 3


def test_rewards_of_many_goals_at_once():
    env = ReachGoalEnv()
    rng = np.random.default_rng(1)
    achieved, desired = rng.uniform(-0.1, 0.1, (2, 500, 3))
    rewards = env.compute_reward(achieved, desired, [{}] * 500)
    distances = np.linalg.norm(achieved - desired, axis=1)
    np.testing.assert_array_equal(rewards, -(distances > 0.05).astype(float))
    assert [env.compute_reward(a, d, {}) for a, d in zip(achieved, desired, strict=True)] == list(
        rewards
    )
    np.testing.assert_array_equal(
        env.compute_terminated(achieved, desired, [{}] * 500), distances <= 0.05
    )
    assert not env.compute_truncated(achieved, desired, [{}] * 500).any()
    batch = ReachGoalVectorEnv(500)
    infos = [{}, {"collision": True}] * 250
    expected = [env.compute_reward(*each) for each in zip(achieved, desired, infos, strict=True)]
    np.testing.assert_array_equal(batch.compute_reward(achieved, desired, infos), expected)


def test_observation_is_that_of_the_flat_environment_taken_apart():
    flat, goal = ReachEnv("both"), ReachGoalEnv("both")
    plain, parts = flat.reset(seed=5)[0], goal.reset(seed=5)[0]
    places = flat.simulator.world.layout.places
    own = np.concatenate([plain[places["orientation"]], plain[places["position"]]])
    np.testing.assert_array_equal(parts["observation"], own)
    np.testing.assert_array_equal(parts["desired_goal"], plain[:3])
    tool = flat.simulator.arm.tool_position(flat.episodes.q[0])
    np.testing.assert_allclose(parts["achieved_goal"], tool, atol=1e-15)


def test_contact_refuses_the_move_and_the_episode_goes_on():
    """The arm leans over until it would touch the ground; then it can lift again."""
    env = ReachGoalEnv()
    env.reset(options=DOWN)
    for _ in range(40):
        before = env.simulator.arm.tool_position(env.episodes.q[0])
        observation, reward, terminated, truncated, info = env.step([0, 1, 0, 0, 0])
        if info["collision"]:
            break
    assert env.contact_names[info["contact"]] == ("hand", "ground")
    assert (reward, terminated, truncated, info["is_success"]) == (-2.0, False, False, False)
    np.testing.assert_allclose(observation["achieved_goal"], before, atol=1e-15)
    lifted, _, _, _, info = env.step([0, -1, 0, 0, 0])
    assert not info["collision"]
    assert lifted["achieved_goal"][2] > before[2] + 0.05


def test_a_refused_move_costs_what_the_problem_says():
    free, dear = (ReachGoalEnv(reward={"collision": weight}) for weight in (0, -3))
    refused = 0
    for (_, first, *_), (seen, second, _, _, info) in zip(
        episodes(free), episodes(dear), strict=True
    ):
        assert second == first - 3 * info["collision"]
        goals = seen["achieved_goal"], seen["desired_goal"]
        assert dear.compute_reward(*goals, info) == second
        assert dear.compute_reward(*([g] for g in goals), [info]) == [second]
        refused += info["collision"]
    assert refused > 3


def test_after_a_refused_move_contact_is_still_found():
    """Steps after refused ones are judged as in an episode that starts there."""
    env, fresh = ReachGoalEnv("both"), ReachEnv("both")
    rng = np.random.default_rng(2)
    refused = compared = 0
    env.reset(seed=3)
    action = np.zeros(5)
    for _ in range(4000):
        start, goal = env.episodes.q[0].copy(), env.episodes.goal[0].copy()
        if rng.random() < 0.5:
            action = np.sign(rng.uniform(-1, 1, 5))
        _, _, terminated, truncated, info = env.step(action)
        if refused:
            fresh.reset(options={"start": start, "goal": goal})
            _, _, _, _, expected = fresh.step(action)
            assert (info["collision"], info["is_success"]) == (
                expected["collision"],
                expected["success"],
            )
            assert info["distance"] == pytest.approx(expected["distance"], abs=1e-12)
            compared += 1
        refused += info["collision"]
        if terminated or truncated:
            env.reset()
            refused = 0
    assert compared > 500


def test_after_a_refused_move_the_arm_sees_that_it_rests():
    parts = ("goal", "goal_minus_tool", "joint_velocities", "last_action", "commanded", "time_left")
    env = ReachGoalEnv("both", plant="hard", observation={"parts": parts, "history": 2}, horizon=40)
    layout, rng, refused = env.simulator.world.layout, np.random.default_rng(0), 0
    for seed in range(12):
        env.reset(seed=seed)
        pushed, ended = np.sign(rng.uniform(-1, 1, 5)), False
        while not ended:
            action = pushed * rng.uniform(0, 1, 5)
            observation, _, terminated, ended, info = env.step(action)
            assert not terminated
            if not info["collision"]:
                continue
            state, steps = env.episodes, int(env.episodes.steps[0])
            now, before = state.observation[0].reshape(2, layout.width)
            seen = {name: now[place] for name, place in layout.places.items()}
            assert seen["time_left"] == (40 - steps) / 40
            assert before[layout.places["time_left"]] == (41 - steps) / 40
            np.testing.assert_array_equal(seen["commanded"][:5], state.drive[0, COMMAND])
            np.testing.assert_array_equal(seen["last_action"], action)
            assert not seen["joint_velocities"].any()
            np.testing.assert_array_equal(observation["desired_goal"], seen["goal"])
            refused += 1
    assert refused > 50


def test_batch_equals_single_environments():
    batch = gymnasium.make_vec("kinarm/ReachGoalBoth-v0", num_envs=5, tolerance=0.3)
    loop = gymnasium.make_vec(
        "kinarm/ReachGoalBoth-v0", num_envs=5, tolerance=0.3, vectorization_mode="sync"
    )
    rng = np.random.default_rng(0)
    first, second = batch.reset(seed=1), loop.reset(seed=1)
    for _ in range(150):
        for key in ("observation", "achieved_goal", "desired_goal"):
            np.testing.assert_array_equal(first[0][key], second[0][key])
        for one, other in zip(first[1:-1], second[1:-1], strict=True):
            np.testing.assert_array_equal(one, other)
        actions = np.sign(rng.uniform(-1, 1, (5, 5))).astype(np.float32)
        first, second = batch.step(actions), loop.step(actions)
    assert isinstance(batch, ReachGoalVectorEnv)


def test_float32():
    env = ReachGoalEnv(observation_dtype="float32")
    for observation, reward, _, _, info in episodes(env, 100):
        assert all(part.dtype == np.float32 for part in observation.values())
        assert env.observation_space.contains(observation)
        goals = observation["achieved_goal"], observation["desired_goal"]
        assert env.compute_reward(*goals, info) == reward
