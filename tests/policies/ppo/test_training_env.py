"""The environment of trainings held against single environments and its own rules."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")


from kinarm.envs import ReachEnv
from kinarm.errors import InvalidInputError
from kinarm.failed_scenarios import Replay
from kinarm.policies.mirror import find_mirror
from kinarm.policies.normalizer import Normalizer
from kinarm.policies.ppo.training_env import TrainingVecEnv
from kinarm.problem import PROBLEMS
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


@pytest.fixture
def make_env(normalizer):
    def make(seed=0, *, number=NUMBER, mirrored=False, replay=None, stop_at_goal=False, **settings):
        overrides = {"reward": REWARD, "tolerance": 0.5, **settings}
        simulator = Simulator(PROBLEMS["both"].replace(**overrides), threads=1)
        env = TrainingVecEnv(
            simulator,
            number,
            rng=np.random.default_rng(seed),
            mirror=find_mirror(simulator.world) if mirrored else None,
            replay=replay,
            stop_at_goal=stop_at_goal,
        )
        env.normalize_by(normalizer)
        return env

    return make


def begin_single(env, row):
    """A `ReachEnv` in the situation of one arm at its start."""
    states, single = env.states(), ReachEnv(env.simulator.problem)
    start = {"start": states.q[row], "goal": states.goal[row]}
    return single, single.reset(seed=0, options=start)[0]


def normalized(normalizer, observation):
    """As the learner sees it, constants left out."""
    moving = normalizer.std > 1e-6
    return moving, (observation[moving] - normalizer.mean[moving]) / normalizer.std[moving]


@pytest.mark.parametrize(("horizon", "steps"), [(64, 150), (3, 40)])
def test_equals_single_environments(make_env, normalizer, horizon, steps):
    env = make_env(horizon=horizon)
    rng = np.random.default_rng(0)
    seen = env.reset()
    singles = [begin_single(env, row) for row in range(NUMBER)]
    returns, lengths = np.zeros(NUMBER), np.zeros(NUMBER, dtype=int)
    ends = {"success": 0, "collision": 0, "truncated": 0}
    for _ in range(steps):
        for row, (_, observation) in enumerate(singles):
            moving, expected = normalized(normalizer, observation)
            np.testing.assert_allclose(seen[row, moving], expected, rtol=1e-5, atol=1e-5)
            np.testing.assert_array_equal(seen[row, ~moving], 0)
        actions = rng.uniform(-1, 1, (NUMBER, 5)).astype(np.float32)
        seen, rewards, dones, infos = env.step(actions)
        for row, (single, _) in enumerate(singles):
            observation, reward, terminated, truncated, info = single.step(actions[row])
            returns[row] += reward
            lengths[row] += 1
            assert rewards[row] == np.float32(reward)
            assert dones[row] == (terminated or truncated)
            if not dones[row]:
                assert infos[row] == {}
                singles[row] = single, observation
                continue
            moving, expected = normalized(normalizer, observation)
            final = infos[row]["terminal_observation"][moving]
            np.testing.assert_allclose(final, expected, rtol=1e-5, atol=1e-5)
            assert infos[row]["TimeLimit.truncated"] == truncated
            assert infos[row]["is_success"] == info["success"]
            assert infos[row]["episode"]["r"] == pytest.approx(returns[row], abs=1e-9)
            assert infos[row]["episode"]["l"] == lengths[row]
            ends["truncated"] += truncated
            ends["success"] += info["success"]
            ends["collision"] += info["collision"]
            returns[row], lengths[row] = 0.0, 0
            singles[row] = begin_single(env, row)
    assert ends["collision"] > 2
    assert (ends["truncated"] if horizon == 3 else ends["success"]) > 2


def test_restored_episodes_go_on_as_if_nothing_had_happened(make_env):
    env = make_env(4)
    env.reset()
    rng = np.random.default_rng(0)
    for _ in range(40):
        seen = env.step(rng.uniform(-1, 1, (NUMBER, 5)))[0]
    other = make_env(99)
    np.testing.assert_array_equal(other.restore(env.states(), env.failed), seen)
    env.draw_from(np.random.default_rng(5))
    other.draw_from(np.random.default_rng(5))
    ended = 0
    for _ in range(100):
        actions = rng.uniform(-1, 1, (NUMBER, 5))
        first, second = env.step(actions), other.step(actions)
        for a, b in zip(first[:3], second[:3], strict=True):
            np.testing.assert_array_equal(a, b)
        for a, b in zip(first[3], second[3], strict=True):
            assert a.get("episode", {}).get("r") == b.get("episode", {}).get("r")
        ended += first[2].sum()
    assert ended > 5


def test_what_ended_holds_every_episode_once(make_env):
    env = make_env(5)
    env.reset()
    rng = np.random.default_rng(0)
    returns, successes = [], []
    for _ in range(100):
        for info in env.step(rng.uniform(-1, 1, (NUMBER, 5)))[3]:
            if info:
                returns.append(info["episode"]["r"])
                successes.append(info["is_success"])
    record = env.take_ended()
    assert (record.returns, record.successes) == (returns, successes)
    assert record.time > 0
    assert env.take_ended() == ([], [], 0.0)


class TestMirror:
    def test_goals_always_lie_to_the_right(self, make_env):
        plain, mirrored = make_env(number=50), make_env(number=50, mirrored=True)
        plain.reset(), mirrored.reset()
        drawn, met = plain.states(), mirrored.states()
        left = drawn.goal[:, 1] > 0
        assert 10 < left.sum() < 40
        image = np.where(left[:, None], drawn.q * AXES, drawn.q)
        np.testing.assert_array_equal(met.q[:, :5], image[:, :5])  # the last joint is held
        np.testing.assert_array_equal(met.goal[:, 1], -np.abs(drawn.goal[:, 1]))

    def test_right_goals_are_untouched(self, make_env):
        plain, mirrored = make_env(number=30), make_env(number=30, mirrored=True)
        seen, looked = plain.reset(), mirrored.reset()
        right = plain.states().goal[:, 1] < 0
        np.testing.assert_array_equal(seen[right], looked[right])
        actions = np.random.default_rng(2).uniform(-1, 1, (30, 5))
        first, second = plain.step(actions), mirrored.step(actions)
        for k in range(3):
            np.testing.assert_array_equal(first[k][right], second[k][right])


def test_tolerance_can_change_between_restored_states(make_env):
    """All else goes on; episodes end as in an environment that was made with it."""
    env, built = make_env(tolerance=0.05), make_env(tolerance=0.7)
    env.reset()
    states = env.states()
    env.reach_within(0.7)
    np.testing.assert_array_equal(*(each.restore(states, env.failed) for each in (env, built)))
    rng, reached = np.random.default_rng(9), 0
    for each in (env, built):
        each.draw_from(np.random.default_rng(10))
    for _ in range(80):
        actions = rng.uniform(-1, 1, (NUMBER, 5))
        first, second = env.step(actions), built.step(actions)
        for k in range(3):
            np.testing.assert_array_equal(first[k], second[k])
        reached += sum(info.get("is_success", False) for info in first[3])
    assert reached > 0


class TestReplay:
    """Episodes that begin where earlier ones failed."""

    SIZE = 30

    def play(self, env, steps, seed=6):
        """Infos of all episodes that end, each with where it began and what for."""
        rng, ended = np.random.default_rng(seed), []
        begun = env.states()
        for _ in range(steps):
            before = begun
            infos = env.step(rng.uniform(-1, 1, (env.num_envs, 5)))[3]
            begun = env.states()
            for row, info in enumerate(infos):
                if "episode" in info:
                    ended.append((info, (*before.start[row], *before.goal[row])))
        return ended

    @pytest.fixture
    def env(self, make_env):
        env = make_env(11, number=40, replay=Replay(share=0.5, size=self.SIZE))
        env.reset()
        return env

    def test_the_last_failures_are_kept(self, env):
        ended = self.play(env, 60)
        failed = [scenario for info, scenario in ended if not info["is_success"]]
        assert self.SIZE < len(failed) < len(ended)
        np.testing.assert_array_equal(np.hstack(env.failed), failed[-self.SIZE :])

    def test_a_share_begins_where_one_failed(self, env):
        failed, replays = set(), 0
        ended = self.play(env, 150)
        for info, scenario in ended:
            assert info["replayed"] == (scenario in failed)
            replays += info["replayed"]
            if not info["is_success"]:
                failed.add(scenario)
        assert 0.35 < replays / len(ended) < 0.55

    def test_the_record_leaves_them_out(self, env):
        ended = [info for info, _ in self.play(env, 100)]
        new = [info for info in ended if not info["replayed"]]
        assert 0 < len(new) < len(ended)
        record = env.take_ended()
        assert record.successes == [info["is_success"] for info in new]
        assert record.returns == [info["episode"]["r"] for info in new]

    def test_restored_it_goes_on_as_if_nothing_had_happened(self, env, make_env):
        self.play(env, 50)
        other = make_env(99, number=40, replay=Replay(share=0.5, size=self.SIZE))
        other.restore(env.states(), env.failed)
        for each in (env, other):
            each.draw_from(np.random.default_rng(8))
        for first, second in zip(self.play(env, 50), self.play(other, 50), strict=True):
            assert first[1] == second[1]
            assert first[0]["replayed"] == second[0]["replayed"]
        np.testing.assert_array_equal(np.hstack(env.failed), np.hstack(other.failed))


def test_step_before_reset(make_env):
    with pytest.raises(InvalidInputError, match="never begun"):
        make_env().step(np.zeros((NUMBER, 5)))


def test_a_share_of_the_penalty(make_env):
    """All else is rewarded as before."""
    whole, mild = make_env(number=60), make_env(number=60)
    mild.punish_by(0.25)
    rng, touched = np.random.default_rng(3), 0
    for env in (whole, mild):
        env.reset()
    for _ in range(30):
        actions = rng.uniform(-1, 1, (60, whole.simulator.n_actions))
        (_, rewards, _, infos), (_, milder, _, _) = whole.step(actions), mild.step(actions)
        touching = np.array([info.get("collision", False) for info in infos])
        expected = rewards - 0.75 * REWARD.collision * touching
        np.testing.assert_allclose(milder, expected, rtol=0, atol=1e-6)
        touched += touching.sum()
    assert touched > 5


def drive(env, steps=200):
    """Distances, rewards, ends and successes of steps with random actions, a row per step."""
    rng = np.random.default_rng(0)
    env.reset()
    history = []
    for _ in range(steps):
        before = env.states()
        distances = env.simulator.reset(before.q, before.goal).distance
        _, rewards, dones, infos = env.step(rng.uniform(-0.4, 0.4, (NUMBER, 5)).astype(np.float32))
        after = [info.get("distance", np.nan) for info in infos]
        reached = [info.get("is_success", False) for info in infos]
        history.append((distances, before.steps, rewards, dones, after, reached))
    return [np.array(column) for column in zip(*history, strict=True)]


class TestStopAtGoal:
    def test_success_takes_two_steps_within_or_the_last(self, make_env):
        env = make_env(stop_at_goal=True, tolerance=0.9, horizon=4)
        distances, steps, _, dones, after, reached = drive(env)
        assert (after[reached] <= 0.9).all()
        within, last = distances <= 0.9, steps == 3
        assert (within | last)[reached].all()
        assert reached[within & ~last].any()
        assert reached[~within & last].any()
        stayed = within[1:] & ~dones[:-1]  # reached in the step before, which did not end it
        assert stayed.any()
        assert dones[1:][within[1:] & (after[1:] <= 0.9)].all()

    def test_only_a_success_has_its_bonus(self, make_env):
        distances, _, rewards, dones, _, reached = drive(
            make_env(stop_at_goal=True, tolerance=0.9, horizon=4)
        )
        passing = (distances[:-1] > 0.9) & (distances[1:] <= 0.9) & ~dones[:-1]
        assert passing.any()
        assert (rewards[:-1][passing] < 1).all()
        assert (rewards[reached] > 1).all()
