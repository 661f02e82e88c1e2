"""What `sb3_vec_env` makes of problems, ids and settings, and what it refuses."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from kinarm import PROBLEMS
from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.policies import sb3_vec_env


class TestProblems:
    def test_names_files_and_objects(self, tmp_path):
        problem = PROBLEMS["left"].replace(horizon=9)
        path = tmp_path / "mine.toml"
        path.write_text(problem.to_toml())
        made = sb3_vec_env("left", horizon=9), sb3_vec_env(problem), sb3_vec_env(path)
        assert {env.simulator.problem.digest for env in made} == {problem.digest}
        assert {env.num_envs for env in made} == {1}

    @pytest.mark.parametrize("problem", ["left", "right", "both"])
    @pytest.mark.parametrize("prefix", ["", "kinarm:"])
    def test_ids(self, problem, prefix):
        for kind, space in (("Reach", "Box"), ("ReachGoal", "Dict")):
            env_id = f"kinarm/{kind}{problem.capitalize()}-v0"
            env = sb3_vec_env(prefix + env_id, 3)
            assert env.simulator.problem == PROBLEMS[problem]
            assert type(env.observation_space).__name__ == space
            assert (env.num_envs, env.spec.id) == (3, env_id)

    def test_any_problem_may_have_goals(self):
        env = sb3_vec_env("both", 2, goal_conditioned=True, horizon=4)
        assert set(env.reset()) == {"observation", "achieved_goal", "desired_goal"}
        assert (env.step(np.zeros((2, 5)))[1] == -1).all()


@pytest.mark.parametrize("n_envs", [0, -1, 1.5, True, "2", None])
def test_number_of_arms(n_envs):
    with pytest.raises(InvalidInputError, match="n_envs must be a whole number of at least 1"):
        sb3_vec_env("right", n_envs)


@pytest.mark.parametrize("env_id", ["kinarm/ReachUp-v0", "CartPole-v1", "kinarm/ReachRight-v9"])
def test_unknown_environment(env_id):
    with pytest.raises(UnknownNameError, match=f"{env_id}.*available: kinarm/ReachLeft-v0"):
        sb3_vec_env(env_id)


def test_an_environment_without_goals():
    with pytest.raises(UnknownNameError, match="kinarm/ReachRight-v0"):
        sb3_vec_env("kinarm/ReachRight-v0", goal_conditioned=True)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"seed": -1}, "seed must be a whole number of at least 0"),
        ({"speed": 2}, "speed"),
        ({"problem": "up"}, "unknown problem 'up'"),
    ],
)
def test_bad_settings(settings, message):
    with pytest.raises(InvalidInputError, match=message):
        sb3_vec_env(**settings)
