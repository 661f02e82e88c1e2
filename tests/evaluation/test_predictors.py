"""Policies with a memory, and in wrappers, end as Stable-Baselines3 says."""

import gymnasium
import numpy as np
import pytest

from kinarm.envs import ReachEnv
from kinarm.episodes import SUCCESS
from kinarm.errors import InvalidInputError
from kinarm.evaluation import EvaluationRequest, TrialSet, evaluate, find_contestants
from kinarm.evaluation.selection import select_pairs
from kinarm.policies import Policy, load_policy
from kinarm.problem import PROBLEMS

TRIALS, SEED = 12, 3


@pytest.fixture(scope="module")
def trials():
    return TrialSet.draw("right", TRIALS, SEED)


def arms(trials):
    """The trials as a batch of environments."""
    from kinarm.policies import sb3_vec_env

    env = sb3_vec_env(trials.problem, TRIALS, seed=0)
    pairs = zip(trials.starts, trials.goals, strict=True)
    env.set_options([{"start": start, "goal": goal} for start, goal in pairs])
    return env


def judged_by_sb3(model, env):
    """Lengths, successes and final distances of one episode of each arm."""
    from stable_baselines3.common.evaluation import evaluate_policy

    ends = {}

    def note(seen, _):
        if seen["done"]:
            info = seen["info"]
            end = info["episode"]["l"], info["is_success"], info["distance"]
            ends.setdefault(seen["i"], end)

    evaluate_policy(model, env, n_eval_episodes=TRIALS, callback=note, warn=False)
    return [ends[trial] for trial in range(TRIALS)]


def ends_of(evaluation):
    rollouts = evaluation.rollouts
    return list(zip(rollouts.steps, rollouts.success, rollouts.distance, strict=True))


def louder(model):
    """The model with larger actions, which depend more on what it sees."""
    model.policy.action_net.weight.data *= 150
    return model


@pytest.fixture
def recurrent(trials):
    contrib = pytest.importorskip("sb3_contrib")
    return louder(contrib.RecurrentPPO("MlpLstmPolicy", arms(trials), seed=2, device="cpu"))


class TestMemory:
    def test_is_kept_through_an_episode(self, recurrent, trials, tmp_path):
        expected = judged_by_sb3(recurrent, arms(trials))
        recurrent.save(tmp_path / "model.zip")
        (found,) = find_contestants(tmp_path / "model.zip", "right")
        for policy in (recurrent, found):
            assert ends_of(evaluate(policy, "right", TRIALS, SEED)) == expected

    def test_matters(self, recurrent, trials):
        """Without memory, the same networks end elsewhere."""

        def forgetful(observations):
            return recurrent.predict(observations.astype(np.float32), deterministic=True)[0]

        ends = ends_of(evaluate(forgetful, "right", TRIALS, SEED))
        assert ends != judged_by_sb3(recurrent, arms(trials))

    def test_functions_may_ask_which_episode_is_which(self):
        numbers = []

        def policy(observations, rows):
            numbers.append(rows.copy())
            return np.zeros((len(observations), 5))

        evaluation = evaluate(policy, "right", TRIALS, SEED)
        steps = evaluation.rollouts.steps
        for step, rows in enumerate(numbers):
            np.testing.assert_array_equal(rows, np.flatnonzero(steps > step))


class TestStatistics:
    def test_those_of_the_environment_of_a_model_are_used(self, trials):
        sb3 = pytest.importorskip("stable_baselines3")
        from stable_baselines3.common.vec_env import VecNormalize

        env = VecNormalize(arms(trials))
        model = louder(sb3.PPO("MlpPolicy", env, n_steps=16, seed=2, device="cpu").learn(200))
        env.training = False
        env.venv.set_options(
            [{"start": s, "goal": g} for s, g in zip(*scenarios(trials), strict=True)]
        )
        expected = judged_by_sb3(model, env)
        evaluation = evaluate(model, "right", TRIALS, SEED)
        assert ends_of(evaluation) == expected
        assert "observations normalised by VecNormalize" in evaluation.contestant.note


def test_a_model_of_a_goal_environment_sees_goals_apart():
    sb3 = pytest.importorskip("stable_baselines3")
    env = gymnasium.make("kinarm/ReachGoalRight-v0")
    model = louder(sb3.PPO("MultiInputPolicy", env, n_steps=64, seed=2, device="cpu"))
    expected = evaluate(Policy.from_sb3(model), "right", TRIALS, SEED).rollouts
    found = evaluate(model, "right", TRIALS, SEED).rollouts
    np.testing.assert_array_equal(found.steps, expected.steps)
    np.testing.assert_allclose(found.distance, expected.distance, rtol=0, atol=1e-4)


class Numbered:
    """Acts as drawn for each trial and step, as its rows tell."""

    def __init__(self):
        self.drawn = np.random.default_rng(0).uniform(-1, 1, (TRIALS, 65, 5))
        self.steps = np.zeros(TRIALS, dtype=int)

    def __call__(self, observations, *, rows):
        self.steps[rows] += 1
        return self.drawn[rows, self.steps[rows] - 1]


def scenarios(trials):
    return trials.starts, trials.goals


def stacked(venv):
    from stable_baselines3.common.vec_env import VecFrameStack

    return VecFrameStack(venv, 3)


class Clumsy(gymnasium.Wrapper):
    """Shows the action before, and moves at half the speed."""

    def __init__(self, env):
        super().__init__(env)
        low, high = (np.concatenate([end, np.full(5, s)]) for end, s in self._ends(env))
        self.observation_space = gymnasium.spaces.Box(low, high, dtype=np.float64)

    @staticmethod
    def _ends(env):
        return (env.observation_space.low, -1.0), (env.observation_space.high, 1.0)

    def reset(self, **settings):
        observation, info = self.env.reset(**settings)
        return np.concatenate([observation, np.zeros(5)]), info

    def step(self, action):
        observation, *rest = self.env.step(0.5 * np.asarray(action))
        return np.concatenate([observation, action]), *rest


def twice(venv):
    """Repeats actions, as wrappers that skip frames do; the end may come between."""
    from stable_baselines3.common.vec_env import VecEnvWrapper

    class Twice(VecEnvWrapper):
        def reset(self):
            return self.venv.reset()

        def step_wait(self):
            self.venv.step_wait()
            self.venv.step_async(self.venv._actions)
            return self.venv.step_wait()

    return Twice(venv)


class TestWrapper:
    @pytest.mark.parametrize("kind", ["gymnasium", "sb3"])
    def test_functions_may_ask_which_episode_is_which(self, kind):
        pytest.importorskip("stable_baselines3")
        wrapper = (lambda env: env) if kind == "gymnasium" else (lambda venv: venv)
        expected = ends_of(evaluate(Numbered(), "right", TRIALS, SEED))
        assert ends_of(evaluate(Numbered(), "right", TRIALS, SEED, wrapper=wrapper)) == expected

    def test_actions_repeated_beyond_the_horizon(self):
        """An odd horizon ends between the two; what the next episode does is not kept."""
        pytest.importorskip("stable_baselines3")
        problem = PROBLEMS["right"].replace(horizon=5)

        def away(observations):
            return np.tanh(observations[:, 3:8])

        evaluation = evaluate(away, problem, TRIALS, SEED, wrapper=twice)
        simulator = evaluation.trials.simulator
        episodes = simulator.reset(*scenarios(evaluation.trials))
        for step in range(5):
            if step % 2 == 0:
                actions = away(episodes.observation)
            simulator.step(episodes, actions)
        found = evaluation.rollouts
        np.testing.assert_array_equal(found.steps, episodes.steps)
        np.testing.assert_array_equal(found.success, episodes.status == SUCCESS)
        np.testing.assert_allclose(found.distance, episodes.distance, rtol=0, atol=1e-6)

    def test_of_stable_baselines3(self, trials, tmp_path):
        sb3 = pytest.importorskip("stable_baselines3")
        model = louder(sb3.PPO("MlpPolicy", stacked(arms(trials)), seed=2, device="cpu"))
        expected = judged_by_sb3(model, stacked(arms(trials)))
        evaluation = evaluate(model, "right", TRIALS, SEED, wrapper=stacked)
        assert ends_of(evaluation) == expected
        assert evaluation.contestant.note == "PPO: in wrapper stacked"
        model.save(tmp_path / "model.zip")
        with pytest.raises(InvalidInputError, match="in a wrapper that changes observations"):
            find_contestants(tmp_path / "model.zip", "right")
        (found,) = find_contestants(tmp_path / "model.zip", "right", wrapper=stacked)
        assert ends_of(evaluate(found, "right", TRIALS, SEED)) == expected

    def test_of_gymnasium(self, trials):
        """Held against the loop that a user would write."""
        linear = load_policy("ars-tuned-both")

        def policy(observations):
            actions = linear(observations[:, :48])
            return np.clip(actions + 0.3 * observations[:, 48:], -1, 1)

        expected = []
        env = Clumsy(ReachEnv("right"))
        for start, goal in zip(*scenarios(trials), strict=True):
            observation, _ = env.reset(options={"start": start, "goal": goal})
            over, steps = False, 0
            while not over:
                action = policy(observation[None])[0]
                observation, _, terminated, truncated, info = env.step(action)
                over, steps = terminated or truncated, steps + 1
            expected.append((steps, info["success"], info["distance"]))
        evaluation = evaluate(policy, "right", TRIALS, SEED, wrapper=Clumsy, oracle=True)
        assert ends_of(evaluation) == expected
        assert any(success for _, success, _ in expected)

    @pytest.mark.parametrize("kind", ["gymnasium", "sb3"])
    def test_shows_a_policy_what_it_learnt_to_see(self, kind):
        pytest.importorskip("stable_baselines3")
        wrapper = (lambda env: env) if kind == "gymnasium" else (lambda venv: venv)
        policy = load_policy("ppo-best-both-seed0")
        assert policy.observation != PROBLEMS["right"].observation
        expected = evaluate(policy, "right", TRIALS, SEED).rollouts
        found = evaluate(policy, "right", TRIALS, SEED, wrapper=wrapper).rollouts
        np.testing.assert_array_equal(found.outcomes, expected.outcomes)
        np.testing.assert_allclose(found.distance, expected.distance, rtol=0, atol=1e-4)

    def test_by_name(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        (tmp_path / "halves_for_tests.py").write_text(
            "import gymnasium, numpy as np\n"
            "def half(env):\n"
            "    space = env.action_space\n"
            "    return gymnasium.wrappers.TransformAction(env, lambda a: 0.5 * a, space)\n"
            "number = 3\n"
        )
        (half,) = find_contestants("ars-tuned-both-seed0", wrapper="halves_for_tests:half")
        assert half.note == "ars-tuned-both-seed0: in wrapper halves_for_tests:half"
        slow, fast = (evaluate(each, trials=TRIALS).rollouts.steps for each in (half, half.policy))
        assert slow.mean() > 1.3 * fast.mean()
        again = evaluate(half.policy, trials=TRIALS, wrapper="halves_for_tests:half")
        np.testing.assert_array_equal(again.rollouts.steps, slow)
        for name in ("random", half.policy):
            with pytest.raises(InvalidInputError, match="wrapper .* is no function"):
                evaluate(name, "right", wrapper="halves_for_tests:number")
        # Also around what nobody named.
        request = EvaluationRequest(problems=("left",), wrapper="halves_for_tests:half")
        chosen = {contestant.name: contestant for contestant, _ in select_pairs(request)}
        assert chosen["ars-best-both-seed0"].wrapped
        assert not chosen["random"].wrapped
