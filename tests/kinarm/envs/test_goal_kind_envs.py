"""Environments, mirror, recordings and pages of goals beyond standing points."""

import warnings

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from kinarm.envs import ReachEnv, ReachGoalEnv, ReachVectorEnv
from kinarm.errors import InvalidInputError
from kinarm.goals import GoalSpecification
from kinarm.policies.mirror import find_mirror
from kinarm.problem import ReachProblem
from kinarm.recording import load_recordings, record_rollouts, save_recordings
from kinarm.simulator import Simulator
from kinarm.viewer.pages import replay_page
from kinarm.viewer.parts import goal_pose

KINDS = ("position", "direction", "pose", "configuration")
MOTION = {"velocity": [0.05, 0.0, 0.0]}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("make", [ReachEnv, ReachGoalEnv])
def test_checkers_accept_them(make, kind):
    env = make("both", goal={"kind": kind})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        check_env(env, skip_render_check=True)
        checker = pytest.importorskip("stable_baselines3.common.env_checker")
        checker.check_env(env)
    observation, info = env.reset(seed=3)
    assert env.observation_space.contains(observation)
    assert ("turn" in env.step(env.action_space.sample())[-1]) == (kind != "position")
    assert "distance" in info


@pytest.mark.parametrize("kind", KINDS)
def test_rewards_of_pairs_are_those_of_steps(kind):
    env = ReachGoalEnv("right", goal={"kind": kind, "rotation_tolerance": 1.0}, tolerance=0.3)
    observation, _ = env.reset(seed=0)
    for _ in range(64):
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
        goals = observation["achieved_goal"], observation["desired_goal"]
        assert reward == env.compute_reward(*goals, info)
        assert terminated == env.compute_terminated(*goals, info)
        assert (info["distance"] <= 0.3 and info.get("turn", 0.0) <= 1.0) == terminated
        if terminated or truncated:
            break


def test_goals_that_depend_on_more_than_a_pair_are_no_dictionaries():
    for goal in ({"hold": 2}, {"speed": 0.1}, {"sequence": 2}, {"motion": MOTION}):
        with pytest.raises(InvalidInputError, match="stand and are reached once touched"):
            ReachGoalEnv("right", goal=goal)


def test_a_batch_is_like_single_arms():
    goal = {"kind": "pose", "sequence": 2}
    envs = ReachVectorEnv(3, "both", goal=goal, tolerance=0.2, horizon=16)
    single = ReachEnv("both", goal=goal, tolerance=0.2, horizon=16)
    seen, _ = envs.reset(seed=5)
    one, _ = single.reset(seed=6)
    np.testing.assert_array_equal(seen[1], one)
    rng = np.random.default_rng(0)
    for _ in range(12):
        actions = rng.uniform(-1, 1, (3, 6))
        seen, _, terminated, truncated, infos = envs.step(actions)
        one, *_, info = single.step(actions[1])
        np.testing.assert_array_equal(seen[1], one)
        assert infos["goals_reached"][1] == info["goals_reached"]
        if terminated[1] or truncated[1]:
            break


def test_a_goal_can_be_set():
    env = ReachEnv("right", goal={"kind": "direction"})
    goal = [0.3, -0.6, 0.4, 0.0, 0.0, -1.0]
    observation, _ = env.reset(seed=0, options={"goal": goal})
    np.testing.assert_array_equal(observation[48:51], goal[3:])
    with pytest.raises(InvalidInputError, match="must have length 1"):
        env.reset(options={"start": np.zeros(6), "goal": [0.3, -0.6, 0.4, 0.0, 0.0, -2.0]})


@pytest.mark.parametrize("kind", KINDS)
def test_the_mirror_reflects_goals(kind):
    simulator = Simulator(ReachProblem.load("both").replace(goal={"kind": kind}), threads=1)
    mirror = find_mirror(simulator.world)
    starts, goals = simulator.sample(np.random.default_rng(0), 64)
    ours = simulator.world.observe(starts, goals)
    reflected = simulator.world.observe(*mirror.scenarios_from_the_right(starts, goals))
    left = goals[:, 1] > 0
    np.testing.assert_allclose(reflected[left], (ours * mirror.observations)[left], atol=1e-12)
    np.testing.assert_array_equal(reflected[~left], ours[~left])


@pytest.mark.parametrize("goal", [{"kind": "pose", "motion": MOTION}, {"kind": "direction"}])
def test_recordings_and_pages_show_them(goal, tmp_path):
    simulator = Simulator(ReachProblem.load("right").replace(goal=goal), threads=1)
    starts, goals = simulator.sample(np.random.default_rng(0), 2)

    def still(seen):
        return np.zeros((len(seen), simulator.n_actions))

    rollouts = simulator.rollout(still, starts, goals, record=True)
    recordings = record_rollouts(simulator, rollouts, "still")
    save_recordings(tmp_path / "two.npz", recordings)
    for made, read in zip(recordings, load_recordings(tmp_path / "two.npz"), strict=True):
        np.testing.assert_array_equal(made.goal, read.goal)
        assert (made.goals is None) == (read.goals is None) == ("motion" not in goal)
        if made.goals is not None:
            np.testing.assert_array_equal(made.goals, read.goals)
            assert len(np.unique(made.goals[:, 0])) > 20
    assert "kinarm replay" in replay_page(recordings).html


def test_marks_point_along_directions_and_rotations():
    pose, direction = (GoalSpecification(kind=kind) for kind in ("pose", "direction"))
    half = np.sqrt(0.5)
    np.testing.assert_allclose(
        goal_pose(pose, [1, 2, 3, half, 0, 0, half])[:3],
        [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3]],
        atol=1e-15,
    )
    np.testing.assert_allclose(goal_pose(direction, [0, 0, 0, 0, 0.6, 0.8])[:3, 2], [0, 0.6, 0.8])
