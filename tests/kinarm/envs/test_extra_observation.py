"""Entries of one's own in environments, and lists of parts in spaces and dictionaries."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from kinarm import ExtraObservation, ReachEnv, ReachGoalEnv, ReachVectorEnv
from kinarm.errors import InvalidInputError

LISTS = {
    "joints": {"parts": ["goal", "goal_minus_tool", "joint_angles", "joint_velocities"]},
    "bodies": {"parts": ["time_left", "goal", "obstacles", "goal_minus_tool", "proximity"]},
    "history": {"history": 3},
}
MOST = np.full(6, 4.0)


def squares(simulator, episodes):
    """Squares of the joint positions."""
    assert simulator.arm.n_joints == episodes.q.shape[1]
    return np.minimum(episodes.q**2, MOST)


EXTRA = ExtraObservation(squares, np.zeros(6), MOST)


@pytest.mark.parametrize("extra", [None, EXTRA])
@pytest.mark.parametrize("name", LISTS)
@pytest.mark.parametrize("kind", ["kinarm/ReachBoth-v0", "kinarm/ReachGoalBoth-v0"])
def test_checkers_accept_lists(kind, name, extra):
    env = gymnasium.make(
        kind, observation=LISTS[name], extra_observation=extra, observation_dtype="float32"
    )
    check_env(env.unwrapped, skip_render_check=True)
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(env.unwrapped)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_batches_append_entries_as_single_arms_do(mode):
    settings = {"observation": LISTS["bodies"], "extra_observation": EXTRA, "horizon": 5}
    batch, plain = ReachVectorEnv(3, "both", autoreset_mode=mode, **settings), []
    shown = batch.reset(seed=4)[0]
    for arm in range(3):
        plain.append(ReachEnv("both", **settings))
        np.testing.assert_array_equal(plain[arm].reset(seed=4 + arm)[0], shown[arm])
    assert batch.observation_space.contains(shown)
    for _ in range(5):
        actions = np.full((3, 5), 0.05)
        shown, _, _, truncated, infos = batch.step(actions)
        singles = [env.step(action)[0] for env, action in zip(plain, actions, strict=True)]
        finals = infos["final_obs"] if mode == "SameStep" and truncated.any() else shown
        np.testing.assert_array_equal(np.stack(list(finals)), singles)
        np.testing.assert_array_equal(shown[:, -6:], np.minimum(batch.configuration**2, MOST))


def test_dictionaries_of_goals_have_them_in_the_observation():
    env = ReachGoalEnv("both", observation=LISTS["joints"], extra_observation=EXTRA)
    shown = env.reset(seed=1)[0]
    q = env.configuration
    own = np.stack([np.sin(q), np.cos(q)], axis=1).ravel()
    np.testing.assert_allclose(
        shown["observation"],
        [*own, *np.zeros(5), *squares(env.simulator, env.episodes)[0]],
        atol=1e-12,
    )
    tool = env.simulator.arm.tool_position(q)
    np.testing.assert_allclose(shown["achieved_goal"], tool, atol=1e-12)


def test_stable_baselines3_sees_them():
    pytest.importorskip("stable_baselines3")
    from kinarm.policies import sb3_vec_env

    env = sb3_vec_env("both", 2, seed=0, observation=["goal"], extra_observation=EXTRA)
    np.testing.assert_allclose(env.reset()[:, 3:], np.minimum(env.configuration**2, 4), rtol=1e-6)
    shown, _, _, _ = env.step(np.zeros((2, 5)))
    assert env.observation_space.shape == shown.shape[1:] == (9,)


def test_goals_as_a_dictionary_need_the_goal():
    with pytest.raises(InvalidInputError, match="need the part 'goal_minus_tool' of the"):
        ReachGoalEnv("both", observation=["goal", "joint_positions"])


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        ((squares, [0.0], [1.0, 2.0]), r"high of extra_observation must have shape \(1\)"),
        ((squares, [1.0], [0.0]), "a low above its high"),
        ((squares, [np.nan], [0.0]), "low of extra_observation must be finite"),
    ],
)
def test_bad_ends_are_refused(extra, message):
    with pytest.raises(InvalidInputError, match=message):
        ExtraObservation(*extra)


def test_entries_of_another_number_are_refused():
    env = ReachEnv(extra_observation=ExtraObservation(squares, [0.0], [1.0]))
    with pytest.raises(InvalidInputError, match=r"extra_observation must have shape \(1, 1\)"):
        env.reset(seed=0)
