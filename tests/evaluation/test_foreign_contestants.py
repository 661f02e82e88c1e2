"""Policies that are not kinarm's own: models of Stable-Baselines3, and modules of a user's."""

import subprocess
import sys

import numpy as np
import pytest

from kinarm.envs import ReachEnv
from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.evaluation import evaluate, find_contestants
from kinarm.policies import Policy
from kinarm.problem import PROBLEMS

MODULE = """
import numpy as np
from kinarm.policies import load_policy

def towards(observations):
    return np.tanh(observations[:, 3:8])

class Remembering:
    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        assert deterministic
        return np.tanh(observation[:, 3:8]), state

class Plain:
    def predict(self, observation):
        return np.tanh(observation[:, 3:8])

remembering, plain = Remembering(), Plain()
shipped = load_policy("ars-tuned-both")
number = 3
_hidden = towards
"""


@pytest.fixture
def module(tmp_path, monkeypatch):
    """The name of a module in the current directory."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    (tmp_path / "mine_for_tests.py").write_text(MODULE)
    yield "mine_for_tests"
    sys.modules.pop("mine_for_tests", None)


class TestModule:
    @pytest.mark.parametrize("name", ["towards", "remembering", "plain"])
    def test_whatever_chooses_actions(self, module, name):
        (contestant,) = find_contestants(f"{module}:{name}")
        assert (contestant.name, contestant.algorithm) == (f"{module}:{name}", "function")
        found = evaluate(contestant, "right", trials=20)
        expected = evaluate(lambda seen: np.tanh(seen[:, 3:8]), "right", trials=20)
        np.testing.assert_array_equal(found.rollouts.distance, expected.rollouts.distance)
        again = evaluate(f"{module}:{name}", "right", trials=20)
        np.testing.assert_array_equal(again.rollouts.distance, expected.rollouts.distance)

    def test_a_policy_keeps_what_it_says_of_itself(self, module):
        (contestant,) = find_contestants(f"{module}:shipped")
        assert isinstance(contestant.policy, Policy)
        assert contestant.problem.name == "both"

    def test_it_may_make_an_environment_by_its_id(self, tmp_path):
        """Commands do not register environments before they are needed."""
        made = 'import gymnasium\ngymnasium.make("kinarm/ReachRight-v0")\nact = len\n'
        (tmp_path / "making.py").write_text(made)
        words = ["--policy", "making:act", "--problem", "right", "--trials", "1", "--no-oracle"]
        program = [sys.executable, "-m", "kinarm", "eval", *words]
        done = subprocess.run(program, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert "cannot import" not in done.stderr, done.stderr

    def test_missing_names_are_listed(self, module):
        with pytest.raises(UnknownNameError, match="'nothing'; available: .*towards") as caught:
            find_contestants(f"{module}:nothing")
        assert {"towards", "remembering", "plain", "shipped"} <= set(caught.value.available)
        assert "_hidden" not in caught.value.available

    @pytest.mark.parametrize(
        ("name", "message"),
        [
            ("no_such_module_here:f", "cannot import 'no_such_module_here'.*No module named"),
            ("broken_for_tests:f", "cannot import 'broken_for_tests'.*oh no"),
        ],
    )
    def test_modules_that_cannot_be_imported(self, module, tmp_path, name, message):
        (tmp_path / "broken_for_tests.py").write_text("raise RuntimeError('oh no')")
        with pytest.raises(InvalidInputError, match=message):
            find_contestants(name)

    @pytest.mark.parametrize("name", ["number", "Plain"])
    def test_what_chooses_no_actions(self, module, name):
        with pytest.raises(InvalidInputError, match="neither a function of observations nor"):
            find_contestants(f"{module}:{name}")


@pytest.fixture
def model():
    sb3 = pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    env = VecNormalize(DummyVecEnv([lambda: ReachEnv("right")]))
    env.reset()
    for _ in range(30):
        env.step(np.ones((1, 5)))
    return sb3.PPO("MlpPolicy", env, seed=1, n_steps=64, device="cpu")


class TestModel:
    def test_takes_part_on_the_problem_that_is_given(self, model, tmp_path):
        model.save(tmp_path / "model.zip")
        (contestant,) = find_contestants(tmp_path / "model.zip", "right")
        assert (contestant.name, contestant.algorithm, contestant.recipe) == ("model", "ppo", "sb3")
        note = "model: observations not normalised, without VecNormalize"
        assert (contestant.seed, contestant.note) == (1, note)
        assert contestant.problem.digest == PROBLEMS["right"].digest
        evaluation = evaluate(tmp_path / "model.zip", "right", trials=10)
        expected = evaluate(Policy.from_sb3(tmp_path / "model.zip", "right"), trials=10)
        np.testing.assert_array_equal(evaluation.rollouts.distance, expected.rollouts.distance)

    @pytest.mark.parametrize("learnt", [False, True])
    def test_statistics_that_lie_beside_it_may_be_those_of_another(self, model, tmp_path, learnt):
        """They are not even opened, and a model that needs some is refused."""
        if learnt:
            model.learn(1)
        model.save(tmp_path / "best_model.zip")
        beside = tmp_path / "vecnormalize.pkl"
        beside.write_bytes(b"not to be opened")
        if learnt:
            with pytest.raises(InvalidInputError, match=f"--vec-normalize {beside}"):
                find_contestants(tmp_path / "best_model.zip", "right")
            with pytest.raises(InvalidInputError, match=f"--vec-normalize {beside}"):
                Policy.from_sb3(tmp_path / "best_model.zip", "right")
        model.get_vec_normalize_env().save(beside)
        seen = np.random.default_rng(0).normal(size=(20, 48))
        for given in ("none", beside):
            (contestant,) = find_contestants(tmp_path / "best_model.zip", "right", given)
            own = Policy.from_sb3(model, vec_normalize=given)
            np.testing.assert_array_equal(contestant.policy(seen), own(seen))

    def test_a_folder_of_checkpoints(self, model, tmp_path):
        for steps in (1000, 500):
            model.save(tmp_path / f"rl_model_{steps}_steps.zip")
        found = find_contestants(tmp_path, "right", "none")
        assert [each.name for each in found] == ["rl_model_500_steps", "rl_model_1000_steps"]

    def test_needs_a_problem(self, model, tmp_path):
        model.save(tmp_path / "model.zip")
        with pytest.raises(InvalidInputError, match="model.zip': the model does not say which"):
            find_contestants(tmp_path / "model.zip", vec_normalize="none")


@pytest.mark.parametrize("policy", ["ppo-paper-right", "ars-tuned-both"])
@pytest.mark.parametrize("name", ["kinarm/ReachRight-v0", "kinarm/ReachGoalRight-v0"])
def test_stable_baselines3_evaluates_every_policy(policy, name):
    evaluation = pytest.importorskip("stable_baselines3.common.evaluation")
    from stable_baselines3.common.env_util import make_vec_env

    from kinarm.policies import load_policy

    env = make_vec_env(name, n_envs=2, seed=0)
    returns, lengths = evaluation.evaluate_policy(
        load_policy(policy), env, n_eval_episodes=8, return_episode_rewards=True
    )
    assert len(returns) == 8
    assert np.mean(lengths) < 50
