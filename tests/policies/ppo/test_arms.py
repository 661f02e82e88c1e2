"""The arms of trainings held against single environments and their own rules."""

from dataclasses import replace

import numpy as np
import pytest

from kinarm.bodies import RandomBodies
from kinarm.envs import ReachEnv
from kinarm.failed_scenarios import FailedScenarios
from kinarm.policies import Normalizer, PPOConfig, PPOState
from kinarm.policies.ppo import EpisodeStates
from kinarm.policies.ppo.arms import TrainingArms
from kinarm.policies.ppo.learner import PPOTraining
from kinarm.policies.ppo.networks import actor_policy
from kinarm.problem import PROBLEMS
from kinarm.randomness import Stream, stream_generator
from kinarm.simulator import Simulator
from kinarm.task import RewardWeights

NUMBER = 7
AXES = np.array([-1.0, 1.0, 1.0, -1.0, 1.0, -1.0])
"""Signs of the axes in the mirror."""
REWARD = RewardWeights(success=2.0, step=-0.1)


@pytest.fixture(scope="module")
def normalizer():
    simulator = Simulator("both", threads=1)
    return Normalizer.of(simulator.world.observe(*simulator.sample(np.random.default_rng(1), 500)))


def made(*, number=NUMBER, horizon=64, tolerance=0.5, changes=None, **settings):
    """Arms that have not begun, for a changed problem."""
    always = {"tolerance": tolerance, "horizon": horizon, "reward": REWARD}
    problem = PROBLEMS["both"].replace(**always, **(changes or {}))
    config = PPOConfig(problem=problem, n_envs=number, n_steps=100, batch_size=20, **settings)
    return TrainingArms(config)


@pytest.fixture
def begun(normalizer):
    def begin(seed=0, **settings):
        arms, rng = made(**settings), np.random.default_rng(seed)
        nothing, size = np.zeros(0, dtype=np.float32), arms.simulator.n_observations
        same = size == len(normalizer.mean)
        state = PPOState(
            parameters=nothing,
            first_moment=nothing,
            second_moment=nothing,
            normalizer=normalizer if same else Normalizer.of(rng.normal(size=(9, size))),
            episodes=EpisodeStates.begun(*arms.sample(rng, arms.config.n_envs)),
            failed=FailedScenarios.none(6),
            scenarios=0,
        )
        arms.restore(state, rng)
        return arms, state

    return begin


def go_on(arms, state):
    """The state in which the arms are now."""
    return replace(state, episodes=arms.states(), failed=arms.failed, scenarios=arms.scenarios)


def test_scenarios_come_from_lots_wherever_a_training_goes_on(begun, monkeypatch):
    monkeypatch.setattr("kinarm.policies.ppo.arms.LOT", 10)
    arms, state = begun()
    taken = [arms.next_scenarios(count) for count in (3, 10, 25, 2)]
    drawn = [
        arms.simulator.sample(stream_generator(Stream.PPO_SCENARIOS, 0, lot), 10)
        for lot in range(4)
    ]
    for part, expected in zip(zip(*taken, strict=True), zip(*drawn, strict=True), strict=True):
        np.testing.assert_array_equal(np.concatenate(part), np.concatenate(expected))
    again = made()
    again.restore(replace(state, scenarios=13), np.random.default_rng(0))
    for part, expected in zip(again.next_scenarios(25), taken[2], strict=True):
        np.testing.assert_array_equal(part, expected)


def test_random_bodies_stay_where_a_training_goes_on(begun):
    ball = {"name": "ball", "shape": "sphere", "smallest": (0.05,), "largest": (0.1,)}
    there = RandomBodies(lower=(-0.5, -0.5, 0.2), upper=(0.5, 0.5, 0.7), **ball)
    scene = replace(PROBLEMS["both"].scene, random_bodies=(there,))
    arms, state = begun(number=64, changes={"scene": scene})
    rng = np.random.default_rng(1)
    for _ in range(20):
        arms.step(rng.uniform(-1, 1, (64, 5)).astype(np.float32))
    again = made(number=64, changes={"scene": scene})
    again.restore(go_on(arms, state), rng)
    np.testing.assert_array_equal(again.episodes.scenes, arms.episodes.scenes)
    assert len(np.unique(arms.episodes.scenes[:, 2, 13])) == 64


def begin_single(arms, row):
    """A `ReachEnv` in the situation of one arm at its start."""
    states, single = arms.states(), ReachEnv(arms.simulator.problem)
    start = {"start": states.q[row], "goal": states.goal[row]}
    return single, single.reset(seed=0, options=start)[0]


def assert_normalized(normalizer, found, observation):
    """As the learner sees it, constants left out."""
    moving = normalizer.std > 1e-6
    expected = (observation[moving] - normalizer.mean[moving]) / normalizer.std[moving]
    np.testing.assert_allclose(found[moving], expected, rtol=1e-5, atol=1e-5)
    np.testing.assert_array_equal(found[~moving], 0)


@pytest.mark.parametrize(("horizon", "steps"), [(64, 150), (3, 40)])
def test_equals_single_environments(begun, normalizer, horizon, steps):
    arms, _ = begun(horizon=horizon)
    rng = np.random.default_rng(0)
    singles = [begin_single(arms, row) for row in range(NUMBER)]
    returns, told, reached = np.zeros(NUMBER), [], []
    ends = {"success": 0, "collision": 0, "truncated": 0}
    for _ in range(steps):
        for seen, (_, observation) in zip(arms.observe(), singles, strict=True):
            assert_normalized(normalizer, seen, observation)
        actions = rng.uniform(-1, 1, (NUMBER, 5)).astype(np.float32)
        rewards, ended = arms.step(actions)
        finals = dict(zip(arms.cut_short[-1].tolist(), arms.finals[-1], strict=True))
        for row, (single, _) in enumerate(singles):
            observation, reward, terminated, truncated, info = single.step(actions[row])
            returns[row] += reward
            assert rewards[row] == np.float32(reward)
            assert ended[row] == (terminated or truncated)
            assert (row in finals) == truncated
            if not ended[row]:
                singles[row] = single, observation
                continue
            if truncated:
                assert_normalized(normalizer, finals[row], observation)
            told.append(returns[row])
            reached.append(info["success"])
            ends["truncated"] += truncated
            ends["success"] += info["success"]
            ends["collision"] += info["collision"]
            returns[row] = 0.0
            singles[row] = begin_single(arms, row)
    np.testing.assert_allclose(np.concatenate(arms.returns), told, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(np.concatenate(arms.successes), reached)
    assert ends["collision"] > 2
    assert (ends["truncated"] if horizon == 3 else ends["success"]) > 2


REMEMBERING = {
    "plant": "hard",
    "observation": {"parts": ("goal_minus_tool", "last_action"), "history": 2},
}


@pytest.mark.parametrize(
    "settings", [{}, {"replay_share": 0.5, "replay_size": 30}, {"changes": REMEMBERING}]
)
def test_restored_episodes_go_on_as_if_nothing_had_happened(begun, settings):
    arms, state = begun(4, number=40, **settings)
    rng = np.random.default_rng(0)
    for _ in range(40):
        arms.step(rng.uniform(-1, 1, (40, 5)))
    state = go_on(arms, state)
    other, _ = begun(99, number=40, **settings)
    other.restore(state, np.random.default_rng(5))
    np.testing.assert_array_equal(other.observe(), arms.observe())
    arms._rng = np.random.default_rng(5)
    before = len(np.concatenate(arms.returns))
    for _ in range(100):
        actions = rng.uniform(-1, 1, (40, 5))
        for a, b in zip(arms.step(actions), other.step(actions), strict=True):
            np.testing.assert_array_equal(a, b)
        for a, b in zip(arms.states(), other.states(), strict=True):
            np.testing.assert_array_equal(a, b)
    ended = np.concatenate(other.returns)
    np.testing.assert_array_equal(np.concatenate(arms.returns)[before:], ended)
    assert len(ended) > 5
    np.testing.assert_array_equal(np.hstack(arms.failed), np.hstack(other.failed))


class TestMirror:
    def test_goals_always_lie_to_the_right(self, begun):
        drawn, met = (begun(number=50, symmetric=on)[1].episodes for on in (False, True))
        left = drawn.goal[:, 1] > 0
        assert 10 < left.sum() < 40
        image = np.where(left[:, None], drawn.q * AXES, drawn.q)
        np.testing.assert_array_equal(met.q[:, :5], image[:, :5])  # the last joint is held
        np.testing.assert_array_equal(met.goal[:, 1], -np.abs(drawn.goal[:, 1]))

    def test_later_goals_are_met_as_the_policy_meets_them(self):
        """Also on the left, where the policy sees them reflected."""
        settings = {"goal": {"sequence": 3}, "tolerance": 0.3, "horizon": 30}
        problem = PROBLEMS["both"].replace(**settings)
        config = PPOConfig(problem=problem, n_envs=40, n_steps=50, residual=True, symmetric=True)
        training = PPOTraining(config, threads=1)
        state, arms, networks = training.initial_state(), training.arms, training.networks
        arms.restore(state, np.random.default_rng(0))
        networks.load(state.parameters)
        begun = state.episodes.start, state.episodes.goal
        expected = arms.simulator.rollout(actor_policy(config, state), *begun)
        over, total = np.zeros(40, dtype=bool), np.zeros(40)
        for _ in range(30):
            rates, extent = arms.rates(arms.episodes.observation)
            rewards, ended = arms.step(rates + extent * networks.means(arms.observe()))
            total[~over] += rewards[~over]
            over |= ended
        assert over.all()
        assert (expected.goals_reached > 1).sum() > 5
        np.testing.assert_allclose(total, expected.returns, atol=1e-3)

    def test_right_goals_are_untouched(self, begun):
        plain, mirrored = (begun(number=30, symmetric=on)[0] for on in (False, True))
        right = plain.states().goal[:, 1] < 0
        np.testing.assert_array_equal(plain.observe()[right], mirrored.observe()[right])
        actions = np.random.default_rng(2).uniform(-1, 1, (30, 5))
        first, second = plain.step(actions), mirrored.step(actions)
        np.testing.assert_array_equal(first[0][right], second[0][right])
        np.testing.assert_array_equal(first[1][right], second[1][right])


class TestReplay:
    """Episodes that begin where earlier ones failed."""

    SIZE = 30

    @pytest.fixture
    def arms(self, begun):
        return begun(11, number=40, horizon=20, replay_share=0.5, replay_size=self.SIZE)[0]

    def play(self, arms, steps):
        """Of all episodes that end: whether they are replays and reach the goal; scenarios."""
        rng, ended = np.random.default_rng(6), []
        for _ in range(steps):
            before, replayed = arms.states(), arms.states().replayed
            _, over = arms.step(rng.uniform(-1, 1, (40, 5)))
            for row in np.flatnonzero(over):
                scenario = (*before.start[row], *before.goal[row])
                held = arms.failed.goals[-over.sum() :]
                ended.append((replayed[row], (held == before.goal[row]).all(1).any(), scenario))
        return ended

    def test_the_last_failures_are_kept(self, arms):
        ended = self.play(arms, 60)
        failed = [scenario for _, missed, scenario in ended if missed]
        assert self.SIZE < len(failed) < len(ended)
        np.testing.assert_array_equal(np.hstack(arms.failed), failed[-self.SIZE :])

    def test_a_share_begins_where_one_failed(self, arms):
        failed, replays = set(), 0
        ended = self.play(arms, 150)
        for replayed, missed, scenario in ended:
            assert replayed == (scenario in failed)
            replays += replayed
            if missed:
                failed.add(scenario)
        assert 0.35 < replays / len(ended) < 0.55

    def test_the_record_leaves_them_out(self, arms):
        ended = self.play(arms, 100)
        new = [not missed for replayed, missed, _ in ended if not replayed]
        assert 0 < len(new) < len(ended)
        np.testing.assert_array_equal(np.concatenate(arms.successes), new)
        assert len(np.concatenate(arms.returns)) == len(new)


def test_steps_that_a_shield_replaces_have_a_price(begun):
    free, dear = (
        begun(changes={"shield": True}, intervention_penalty=price)[0] for price in (0.0, 0.5)
    )
    replaced = 0
    for _ in range(20):
        before, actions = dear.episodes.interventions.copy(), np.ones((NUMBER, 5), np.float32)
        cheap, ended = free.step(actions)
        paid, _ = dear.step(actions)
        more = (dear.episodes.interventions - before)[~ended]
        np.testing.assert_allclose((cheap - paid)[~ended], 0.5 * more, rtol=0, atol=1e-6)
        replaced += more.sum()
    assert replaced > 0


def drive(arms, steps=200):
    """Distances before and after, steps, rewards, ends of random actions, a row per step."""
    rng, history = np.random.default_rng(0), []
    for _ in range(steps):
        before, distances = arms.states(), arms.episodes.distance.copy()
        rewards, ended = arms.step(rng.uniform(-0.4, 0.4, (NUMBER, 5)).astype(np.float32))
        history.append((distances, before.steps, rewards, ended))
    return [np.array(column) for column in zip(*history, strict=True)]


def test_success_takes_two_steps_within_the_tolerance(begun):
    arms, _ = begun(training_hold=2, tolerance=0.9, horizon=4)
    distances, _, rewards, ended = drive(arms)
    reached, within = rewards > 1, distances <= 0.9
    assert reached.sum() == np.concatenate(arms.successes).sum() > 0
    assert ended[reached].all()
    assert within[reached].all()
    passing = ~within[:-1] & within[1:] & ~ended[:-1]
    assert passing.any()
    assert not reached[:-1][passing].any()
