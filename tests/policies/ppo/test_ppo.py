"""PPO: returns by hand, exact resuming, the exported actor, and that it learns."""

from dataclasses import replace

import numpy as np
import pytest

from kinarm.errors import InvalidInputError
from kinarm.policies import (
    PPOConfig,
    load_checkpoint,
    save_checkpoint,
    state_policy,
    train_policy,
)
from kinarm.policies.normalizer import input_scale
from kinarm.policies.ppo.learner import PPOTraining
from kinarm.policies.ppo.networks import split_parameters
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.simulator import Simulator
from kinarm.task import RewardWeights

TINY = PPOConfig(
    problem="both",
    n_envs=6,
    n_steps=20,
    batch_size=40,
    n_epochs=3,
    iterations=5,
    net_arch=(12, 10),
    learning_rate_schedule="linear",
    seed=5,
)
LAGGING = ReachProblem.load("left").replace(
    plant="hard", observation=["goal", "joint_angles", "joint_velocities", "last_action"]
)
SHIELDED = ReachProblem.load("left").replace(shield=True)
CONFIGS = {
    "plain": TINY,
    "symmetric": replace(TINY, symmetric=True),
    "replay": replace(TINY, replay_share=0.5, replay_size=10),
    "settling": replace(TINY, training_tolerance=0.2, final_log_std=-4.0),
    "stopping": replace(TINY, training_tolerance=0.9, training_hold=2),
    "shielded": replace(TINY, problem=SHIELDED, intervention_penalty=0.2),
    "plant": replace(TINY, problem=LAGGING, training_tolerance=0.3),
    "right": replace(
        TINY, problem="right", reward=RewardWeights(success=1.0), training_tolerance=0.3
    ),
}


def assert_same_states(first, second):
    """Bit for bit, apart from the clock."""
    for name in ("parameters", "first_moment", "second_moment"):
        assert getattr(first, name).tobytes() == getattr(second, name).tobytes(), name
    parts = (*first.episodes, *first.failed), (*second.episodes, *second.failed)
    for a, b in zip(*parts, strict=True):
        assert a.tobytes() == b.tobytes()
    assert first.normalizer.mean.tobytes() == second.normalizer.mean.tobytes()
    assert first.normalizer.squares.tobytes() == second.normalizer.squares.tobytes()
    np.testing.assert_array_equal(
        [point[:4] for point in first.curve], [point[:4] for point in second.curve]
    )


def assert_same_policies(first, second):
    assert first.mean.tobytes() == second.mean.tobytes()
    assert first.std.tobytes() == second.std.tobytes()
    for a, b in zip(first.layers, second.layers, strict=True):
        assert a.weights.tobytes() == b.weights.tobytes()
        assert a.bias.tobytes() == b.bias.tobytes()


@pytest.fixture(scope="module", params=CONFIGS)
def trained(request):
    """Settings, result and the state after each iteration."""
    states = []
    config = CONFIGS[request.param]
    return config, train_policy(config, on_iteration=states.append), states


class TestAdvantages:
    """Of arms that stand still, with a critic that says the same everywhere."""

    VALUE, REWARD, GAMMA, LAMBDA = 2.0, -0.25, 0.5, 0.5

    @pytest.fixture
    def collect(self):
        def collect(horizon, **settings):
            config = PPOConfig(
                n_envs=2,
                n_steps=3,
                batch_size=6,
                gamma=self.GAMMA,
                gae_lambda=self.LAMBDA,
                problem=PROBLEMS["right"].replace(horizon=horizon),
                reward=RewardWeights(step=self.REWARD),
                log_std_init=-30.0,
                **settings,
            )
            training = PPOTraining(config)
            state = training.initial_state()
            parts = split_parameters(state.parameters, (48, *config.net_arch, 5))
            for weights, bias in (parts.actor[-1], parts.critic[-1]):
                weights[:], bias[:] = 0.0, 0.0
            parts.critic[-1][1][:] = self.VALUE
            training.networks.load(state.parameters)
            training.arms.restore(state, np.random.default_rng(1))
            found = training.collect(np.random.default_rng(2))
            return found.advantages.reshape(2, 3), found.returns.reshape(2, 3)

        return collect

    def test_time_limit_bootstraps(self, collect):
        """Two steps to an episode, three to the rollout.

        Every step has delta = r + gamma V - V = -0.25 + 1 - 2 = -1.25: at the time limit, too,
        the critic's value counts. The second step ends its episode, so that nothing flows back
        into it from the third; the first one gets gamma lambda = 0.25 of the second.
        """
        advantages, _ = collect(horizon=2)
        expected = np.array([-1.25 - 0.25 * 1.25, -1.25, -1.25])
        np.testing.assert_allclose(advantages, np.tile(expected, (2, 1)), atol=1e-5)

    def test_within_an_episode(self, collect):
        """The same deltas, and all steps but the last get 0.25 of the next one."""
        advantages, returns = collect(horizon=64)
        expected = np.array([-1.25 * (1 + 0.25 + 0.0625), -1.25 * 1.25, -1.25])
        np.testing.assert_allclose(advantages, np.tile(expected, (2, 1)), atol=1e-5)
        np.testing.assert_allclose(returns, advantages + self.VALUE, atol=1e-5)

    def test_success_does_not_bootstrap(self, collect):
        """A tolerance beyond reach of any start ends no episode; one that all starts meet cannot
        be drawn. So the arms stand beside the goal, and the tolerance is widened."""
        whole = Simulator.sample
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Simulator, "sample", near_goals(whole))
            advantages = collect(horizon=64, training_tolerance=0.3)[0]
        # delta = r - V at every step, each of which ends an episode.
        np.testing.assert_allclose(advantages, self.REWARD - self.VALUE, atol=1e-5)


def near_goals(sample):
    """Draw as the simulator does, but put every goal 0.1 m above the tool."""

    def draw(simulator, rng, count, **settings):
        starts, _ = sample(simulator, rng, count, **settings)
        tools, _ = simulator.world.screen(starts)
        return starts, tools + np.array([0, 0, 0.1])

    return draw


class TestResuming:
    @pytest.mark.parametrize("stopped_after", [1, 4])
    def test_equals_uninterrupted(self, trained, tmp_path, stopped_after):
        config, result, states = trained
        save_checkpoint(tmp_path / "c.npz", config, states[stopped_after - 1])
        loaded_config, state = load_checkpoint(tmp_path / "c.npz")
        assert loaded_config == config
        later = []
        resumed = train_policy(loaded_config, state=state, on_iteration=later.append)
        assert len(later) == config.iterations - stopped_after
        assert_same_states(later[-1], states[-1])
        assert_same_policies(resumed.policy, result.policy)

    def test_finished_training_is_left_alone(self, trained):
        config, result, states = trained
        again = train_policy(config, state=states[-1], on_iteration=pytest.fail)
        assert_same_policies(again.policy, result.policy)
        assert again.curve == result.curve or np.isnan(again.curve[0].mean_return)

    @pytest.mark.parametrize(("setting", "value"), [("net_arch", (12, 11)), ("n_envs", 12)])
    def test_state_of_another_training_is_refused(self, trained, setting, value):
        config, _, states = trained
        with pytest.raises(InvalidInputError, match="the state to resume has"):
            train_policy(replace(config, **{setting: value}), state=states[0])


class TestResult:
    def test_curve(self, trained):
        _, result, _ = trained
        steps = [point.environment_steps for point in result.curve]
        assert steps == [120, 240, 360, 480, 600]
        assert result.policy.provenance.environment_steps == 600
        times = [point.wall_time for point in result.curve]
        assert times == sorted(times)

    def test_curve_is_of_the_episodes_that_ended(self):
        """Without a move every episode lasts to the horizon and returns 8 step rewards."""
        config = replace(
            TINY,
            problem=PROBLEMS["both"].replace(horizon=8),
            reward=RewardWeights(step=-0.5),
            log_std_init=-30.0,
        )
        first = train_policy(replace(config, iterations=1)).curve[0]
        assert first.mean_return == pytest.approx(-4, abs=0.02)
        assert first.std_return < 0.02
        assert first.success == 0

    def test_curve_without_ended_episodes_is_not_a_number(self):
        config = replace(TINY, n_steps=2, batch_size=12, iterations=1, log_std_init=-30.0)
        point = train_policy(config).curve[0]
        assert np.isnan([point.mean_return, point.std_return, point.success]).all()


def predicted(training, state, observations):
    """What the actor of a training does, given raw observations."""
    mirror, left = training.arms.mirror, np.zeros(len(observations), dtype=bool)
    if mirror is not None:
        left = observations[:, mirror.side] > 0
        observations = np.where(left[:, None], observations * mirror.observations, observations)
    seen = (observations - state.normalizer.mean) * input_scale(state.normalizer.std)
    training.networks.load(state.parameters)
    actions = np.clip(training.networks.means(seen.astype(np.float32)), -1, 1)
    return actions if mirror is None else np.where(left[:, None], actions * mirror.actions, actions)


@pytest.mark.parametrize("changes", [{"start_spread": 0.0}, {"starts": ((0.1,) * 6,)}])
def test_a_policy_sees_its_joints_wherever_episodes_start(changes):
    """Also if all do at one configuration, as of which joints were constant inputs."""
    same, usual = (
        PPOTraining(replace(TINY, problem=problem), threads=1).initial_state().normalizer.std
        for problem in (TINY.problem.replace(**changes), TINY.problem)
    )
    np.testing.assert_array_equal(same > 1e-6, usual > 1e-6)


def test_inputs_at_any_time_of_an_episode_are_of_the_order_of_one():
    """The time was many deviations off when statistics came from its beginning alone."""
    seen = [*TINY.problem.observation.names("position"), "time_left"]
    config = replace(TINY, problem=TINY.problem.replace(observation=seen))
    statistics = PPOTraining(config, threads=1).initial_state().normalizer
    for time in (0.0, 1.0):
        assert abs(time - statistics.mean[-1]) / statistics.std[-1] < 3


def test_policy_acts_like_the_actor(trained):
    config, _, states = trained
    training, state = PPOTraining(config), replace(states[-1], parameters=states[-1].parameters * 1)
    widths = (training.arms.simulator.n_observations, *config.net_arch, 5)
    actor = split_parameters(state.parameters, widths).actor
    actor[-1][0][:] *= 100  # so that some actions are clipped
    policy = state_policy(config, state)
    simulator = Simulator(config.problem, threads=1)
    observations = simulator.world.observe(*simulator.sample(np.random.default_rng(0), 500))
    expected = predicted(training, state, observations)
    assert 0.01 < (np.abs(expected) == 1).mean() < 0.99
    np.testing.assert_allclose(policy(observations), expected, rtol=0, atol=1e-5)


def test_seeds_differ(trained):
    config, result, _ = trained
    other = train_policy(replace(config, seed=6)).policy
    assert (other.layers[0].weights != result.policy.layers[0].weights).any()
    assert (other.mean != result.policy.mean).any()


def test_threads_do_not_matter(trained):
    config = replace(trained[0], iterations=2)
    first = train_policy(config, threads=1).state
    for threads in (2, 3, 11):
        assert_same_states(train_policy(config, threads=threads).state, first)


def test_replays_are_explored_with_more_noise():
    config = replace(
        TINY,
        problem=PROBLEMS["right"].replace(horizon=9),
        iterations=100,
        training_tolerance=0.3,
        replay_share=0.5,
        learning_rate=1e-12,
        log_std_init=-4.0,
        final_log_std=-4.0,
        replay_log_std=-1.0,
    )
    training = PPOTraining(config)
    state = training.initial_state()
    for _ in range(6):
        state = training.iterate(state)
    training.networks.load(state.parameters)
    training.arms.restore(state, np.random.default_rng(1))
    found = training.collect(np.random.default_rng(2))
    deviations = found.actions - training.networks.means(found.observations)
    wide = np.abs(deviations).max(axis=1) > 0.12  # 6.5 narrow deviations
    assert 0.2 < wide.mean() < 0.8
    assert deviations[wide].std() == pytest.approx(np.exp(-1), rel=0.2)
    assert deviations[~wide].std() == pytest.approx(np.exp(-4), rel=0.2)


@pytest.mark.slow
def test_learns():
    """A tenth of the paper's steps bring the tool within centimetres of the goals."""
    config = PPOConfig(
        n_envs=125,
        n_steps=16,
        batch_size=1000,
        iterations=60,
        learning_rate=2e-3,
        learning_rate_schedule="linear",
        gamma=0.9,
        log_std_init=-0.7,
        training_tolerance=0.03,
        reward=RewardWeights(success=1.0),
    )
    beginning = PPOTraining(config).initial_state()
    untrained = state_policy(config, beginning)
    trained = train_policy(config).policy
    simulator = Simulator("right", threads=1)
    starts, goals = simulator.sample(np.random.default_rng(0), 500)
    before = simulator.rollout(untrained, starts, goals)
    after = simulator.rollout(trained, starts, goals)
    assert np.median(before.distance) > 0.5
    assert np.median(after.distance) < 0.2
    assert after.success.mean() > before.success.mean() + 0.1
