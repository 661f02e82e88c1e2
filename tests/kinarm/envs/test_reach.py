"""The single environment: Gymnasium's contract, determinism, settings and errors."""

import copy
import math
import pickle

import gymnasium
import numpy as np
import pinocchio as pin
import pytest
from gymnasium.utils.env_checker import data_equivalence

import kinarm
from kinarm.envs import ENVIRONMENTS
from kinarm.envs.reach import ReachEnv
from kinarm.errors import InvalidInputError, StartInContactError
from kinarm.problem import ReachProblem
from kinarm.task import REWARD_TERMS

HOME = np.zeros(6)


def bitwise_episode(env, seed, steps=80):
    """Everything that an environment returns, over several episodes."""
    seen = [env.reset(seed=seed)]
    env.action_space.seed(seed)
    for _ in range(steps):
        result = env.step(env.action_space.sample())
        seen.append(result)
        if result[2] or result[3]:
            seen.append(env.reset())
    return seen


def goal_of(observation):
    return observation["desired_goal"] if isinstance(observation, dict) else observation[:3]


@pytest.mark.parametrize("name", ENVIRONMENTS)
class TestContract:
    def test_same_seed_same_bits(self, name):
        first, second = gymnasium.make(name), gymnasium.make(name)
        assert data_equivalence(bitwise_episode(first, 7), bitwise_episode(second, 7), exact=True)

    def test_observations_stay_in_the_space(self, name):
        env = gymnasium.make(name)
        for result in bitwise_episode(env, 3, steps=200):
            assert env.observation_space.contains(result[0])

    def test_goals_lie_on_the_benches_of_the_task(self, name):
        env = gymnasium.make(name)
        env.reset(seed=0)
        assert env.unwrapped.simulator.problem == ReachProblem.load(ENVIRONMENTS[name])
        sides = {float(np.sign(goal_of(env.reset()[0])[1])) for _ in range(30)}
        expected = {"left": {1.0}, "right": {-1.0}, "both": {-1.0, 1.0}}
        assert sides == expected[ENVIRONMENTS[name]]


class TestEpisode:
    def test_observation_parts(self, env):
        goal = np.array([0.1, -0.6, 0.325])
        observation, info = env.reset(options={"start": HOME, "goal": goal})
        np.testing.assert_array_equal(observation[:3], goal)
        np.testing.assert_allclose(observation[3:6], goal - [0.625, 0, 0.705], atol=1e-12)
        np.testing.assert_array_equal(observation[6:30].reshape(6, 4)[:, 0], 1)
        assert info["distance"] == pytest.approx(np.linalg.norm(observation[3:6]))

    def test_info_and_reward_terms(self, env):
        env.reset(options={"start": HOME, "goal": [0.625, 1, 0.705]})
        _, reward, terminated, truncated, info = env.step(np.array([1.0, 0, 0, 0, 0]))
        assert set(info) == {
            "distance",
            "success",
            "is_success",
            "collision",
            "contact",
            "configuration",
            *(f"reward_{term}" for term in REWARD_TERMS),
        }
        assert reward == sum(value for key, value in info.items() if key.startswith("reward_"))
        angle = math.radians(7)
        distance = math.dist((0.625, 1), (0.625 * math.cos(angle), 0.625 * math.sin(angle)))
        assert info["distance"] == pytest.approx(distance)
        assert reward == pytest.approx(1 - distance)
        assert info["contact"] == 0
        assert (terminated, truncated) == (False, False)
        assert [type(each) for each in (reward, terminated, truncated)] == [float, bool, bool]

    def test_configuration_is_the_state(self, env):
        """Its forward kinematics, by Pinocchio, is the tool point of the observation."""
        observation, info = env.reset(seed=4)
        model = env.simulator.arm.model
        data, frame = model.createData(), model.getFrameId(env.simulator.arm.tool_frame, pin.BODY)
        for action in np.random.default_rng(0).uniform(-1, 1, (9, 5)):
            before = info["configuration"]
            pin.framesForwardKinematics(model, data, before)
            tool = observation[:3] - observation[3:6]
            np.testing.assert_allclose(data.oMf[frame].translation, tool, rtol=0, atol=1e-12)
            np.testing.assert_array_equal(env.configuration, before)
            env.configuration[:] = np.nan
            before = before.copy()
            observation, *_, info = env.step(action)
            moved = (info["configuration"] - before)[:5]
            lower, upper = model.lowerPositionLimit[:5], model.upperPositionLimit[:5]
            aim = np.clip(before[:5] + action * env.simulator.step_limit, lower, upper)
            np.testing.assert_allclose(moved, aim - before[:5], rtol=0, atol=1e-12)

    def test_contact_ends_and_is_named(self, env):
        env.reset(options={"start": HOME, "goal": [0, 5, 5]})
        for _ in range(64):
            _, reward, terminated, truncated, info = env.step([0, 1, 0, 0, 0])
            if terminated:
                break
        assert info["collision"]
        assert env.contact_names[info["contact"]] == ("hand", "ground")
        assert info["reward_collision"] == -1
        assert reward == -1
        assert not truncated
        assert not info["success"]

    def test_step_after_the_end_is_refused(self, env):
        goal = env.simulator.arm.tool_position([math.radians(7), 0, 0, 0, 0, 0])
        env.reset(options={"start": HOME, "goal": goal})
        assert env.step([1, 0, 0, 0, 0])[2]
        with pytest.raises(InvalidInputError, match="the episode is over"):
            env.step([-1, 0, 0, 0, 0])


class TestSeeding:
    def test_unseeded_resets_go_on_with_the_stream(self, env):
        goals = [env.reset(seed=4)[0][:3], *(env.reset()[0][:3] for _ in range(10))]
        again = [env.reset(seed=4)[0][:3], *(env.reset()[0][:3] for _ in range(10))]
        np.testing.assert_array_equal(goals, again)
        assert len(np.unique(goals, axis=0)) == 11

    def test_actions_do_not_influence_later_scenarios(self, env):
        env.reset(seed=5)
        expected = env.reset()[0]
        env.reset(seed=5)
        env.step(np.ones(5))
        np.testing.assert_array_equal(env.reset()[0], expected)


class TestErrors:
    def test_step_before_reset(self):
        with pytest.raises(InvalidInputError, match="call reset"):
            ReachEnv().step(np.zeros(5))

    @pytest.mark.parametrize(
        "action", [np.zeros(6), np.zeros((1, 5)), 0.0, [np.nan] * 5, "left", [[0.0], []]]
    )
    def test_bad_action(self, env, action):
        env.reset(seed=0)
        with pytest.raises(InvalidInputError, match="action must"):
            env.step(action)

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"starts": HOME}, "unknown reset option 'starts' .did you mean 'start'.*start, goal"),
            ({"start": np.zeros(5)}, "start must have shape"),
            ({"goal": [0, 0, np.nan]}, "goal must be finite"),
            ({"start": np.full(6, 9.0)}, "start lies outside the limits"),
        ],
    )
    def test_bad_options(self, env, options, message):
        with pytest.raises(InvalidInputError, match=message):
            env.reset(seed=0, options=options)

    def test_start_in_contact(self, env):
        start = np.deg2rad([0, 110, -60, 0, 0, 0])
        with pytest.raises(StartInContactError, match="touches"):
            env.reset(options={"start": start})


def pickled(env):
    return pickle.loads(pickle.dumps(env))


class TestCopies:
    @pytest.mark.parametrize("duplicate", [copy.deepcopy, pickled])
    def test_copies_continue_alike(self, duplicate):
        env = ReachEnv("both")
        env.reset(seed=8)
        env.step(np.ones(5) / 3)
        other = duplicate(env)
        for _ in range(20):
            first, second = env.step(np.ones(5) / 3), other.step(np.ones(5) / 3)
            assert data_equivalence(first, second, exact=True)
            if first[2] or first[3]:
                break
        np.testing.assert_array_equal(env.reset()[0], other.reset()[0])


def test_registration_is_part_of_the_import():
    assert kinarm.__version__
    assert set(ENVIRONMENTS) <= set(gymnasium.registry)
    assert ENVIRONMENTS == {
        "kinarm/ReachLeft-v0": "left",
        "kinarm/ReachRight-v0": "right",
        "kinarm/ReachBoth-v0": "both",
        "kinarm/Reach-v0": "right",
        "kinarm/ReachGoalLeft-v0": "left",
        "kinarm/ReachGoalRight-v0": "right",
        "kinarm/ReachGoalBoth-v0": "both",
        "kinarm/ReachGoal-v0": "right",
    }


@pytest.mark.parametrize("kind", ["Reach", "ReachGoal"])
def test_problems_by_name_and_from_files(kind, tmp_path):
    named = gymnasium.make(f"kinarm/{kind}-v0", problem="post-paper").unwrapped
    assert named.simulator.problem == ReachProblem.load("post-paper")
    path = tmp_path / "mine.toml"
    path.write_text('scene = "table"\n[task]\nhorizon = 9')
    made = gymnasium.make(f"kinarm/{kind}-v0", problem=path).unwrapped
    assert made.simulator.problem == ReachProblem.load(path)
    batch = gymnasium.make_vec(f"kinarm/{kind}-v0", num_envs=2, problem=str(path))
    assert batch.reset(seed=0)[1] is not None
    batch.close()
