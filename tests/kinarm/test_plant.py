"""Plants: by hand, by differential equations, and as a whole."""

import numpy as np
import pytest
from reference_episodes import assert_equal_outcome, held_actions, scripted
from scipy.integrate import solve_ivp

from kinarm.errors import KinarmError
from kinarm.plant import Plant
from kinarm.problem import ReachProblem
from kinarm.simulator import Simulator
from tests.helpers.reference import ReferenceSimulator

EVERYTHING = {
    "delay": (0, 3),
    "bandwidth": (5.0, 50.0),
    "damping": (0.5, 1.5),
    "acceleration": (50.0, 400.0),
    "resolution": 1e-3,
    "noise": 0.01,
    "bias": 0.01,
    "calibration": (0.0, 0.02),
    "goal_noise": 0.003,
    "goal_bias": 0.01,
}


def simulator_with(**plant):
    return Simulator("right", threads=1).with_plant(Plant(**plant))


def steps_of(simulator, actions):
    """Joint positions of an arm from home that is far from everything, a row a step."""
    start, goal = simulator.arm.home[None], np.array([[0.0, 0.0, 3.0]])
    episodes = simulator.reset(start, goal)
    path = [episodes.q[0].copy()]
    for action in actions:
        assert not simulator.step(episodes, np.asarray(action)[None]).terminated[0]
        path.append(episodes.q[0].copy())
    return np.array(path)


@pytest.mark.parametrize(
    ("settings", "acceleration"),
    [
        ({"bandwidth": 4.0}, lambda w, e, v: -w * w * e - 2 * w * v),
        ({"bandwidth": 4.0, "damping": 0.3}, lambda w, e, v: -w * w * e - 0.6 * w * v),
        ({"bandwidth": 4.0, "damping": 1.7}, lambda w, e, v: -w * w * e - 3.4 * w * v),
    ],
)
def test_servo_follows_its_differential_equation(settings, acceleration):
    simulator, rate = simulator_with(**settings), 2 * np.pi * 4.0
    moves = np.array([0.6] * 8 + [-0.2] * 4 + [0.0] * 12)
    path = steps_of(simulator, moves[:, None] * [1, 0, 0, 0, 0])[:, 0]
    commands, state, solved = np.cumsum(moves) * simulator.step_limit[0], np.zeros(2), [0.0]
    for command in commands:
        motion = solve_ivp(
            lambda _, y, told=command: (y[1], acceleration(rate, y[0] - told, y[1])),
            (0, simulator.problem.stepping.time_step),
            state,
            rtol=1e-10,
            atol=1e-12,
        )
        state = motion.y[:, -1]
        solved.append(state[0])
    np.testing.assert_allclose(path, solved, rtol=0, atol=1e-8)


@pytest.mark.parametrize("damping", [100.0, 150.0, 1000.0])
def test_servos_of_much_damping_creep(damping):
    simulator, rate = simulator_with(bandwidth=100.0, damping=damping), 2 * np.pi * 100.0
    actions = np.zeros((12, 5))
    actions[0, 0] = 0.6
    path = steps_of(simulator, actions)[:, 0]
    told, slow = 0.6 * simulator.step_limit[0], rate * (damping - np.sqrt(damping**2 - 1))
    creeping = told * (1 - np.exp(-slow * 0.02 * np.arange(13)))
    np.testing.assert_allclose(path, creeping, rtol=0, atol=1e-4 * told)


def test_delay_gives_earlier_commands():
    moves = np.random.default_rng(0).uniform(-0.4, 0.4, (12, 5))
    now, late = (steps_of(simulator_with(noise=1e-9, delay=delay), moves) for delay in (0, 3))
    np.testing.assert_allclose(late[3:], now[:-3], rtol=0, atol=1e-15)
    np.testing.assert_array_equal(late[:4], now[[0, 0, 0, 0]])


def test_limits_of_speed_and_acceleration_hold():
    simulator = simulator_with(acceleration=60.0, bandwidth=20.0)
    moves = np.concatenate([np.full(6, 0.5), np.zeros(6), np.full(10, -0.5), np.zeros(6)])
    path = steps_of(simulator, moves[:, None] * np.ones(5))[:, :5]
    changes = np.diff(path, n=2, axis=0) / 0.02**2
    assert np.abs(np.diff(path, axis=0) / simulator.step_limit).max() < 1 + 1e-12
    assert 20 < np.abs(changes).max() < 60 * (1 + 1e-9)


def test_offsets_stay_for_an_episode_and_commands_come_in_steps():
    simulator = simulator_with(resolution=0.01, calibration=0.02, bias=0.03, goal_bias=0.05)
    starts, goals = simulator.sample(np.random.default_rng(0), 200)
    episodes = simulator.reset(starts, goals)
    off, seen = episodes.sensed - episodes.q, episodes.observation[:, :3] - goals
    simulator.step(episodes, np.full((200, 5), 0.1))
    moved = np.flatnonzero(episodes.status == 0)
    assert len(moved) > 150
    assert 0.045 < np.abs(off[:, :5]).max() <= 0.05
    assert 0.045 < np.abs(seen).max() <= 0.05
    assert not off[:, 5:].any()
    np.testing.assert_allclose(episodes.sensed[moved], episodes.q[moved] + off[moved], atol=1e-15)
    commands = episodes.drive[moved, 0] / 0.01
    np.testing.assert_allclose(commands, np.round(commands), rtol=0, atol=1e-9)
    calibration = episodes.q[moved, :5] - episodes.drive[moved, 0]
    assert 0.015 < np.abs(calibration).max() <= 0.02
    shown = Simulator("right").world.observe(episodes.sensed, episodes.observation[:, :3])
    np.testing.assert_array_equal(episodes.observation, shown)


def test_noise_has_its_deviation_and_differs_by_step_joint_and_episode():
    simulator = simulator_with(noise=0.01, goal_noise=0.02)
    starts, goals = simulator.sample(np.random.default_rng(0), 500)
    episodes, seen = simulator.reset(starts, goals), []
    for _ in range(20):
        simulator.step(episodes, np.zeros((500, 5)))
        off = (episodes.sensed - episodes.q)[:, :5] / 0.01
        seen.append(np.concatenate([off, (episodes.observation[:, :3] - goals) / 0.02], axis=1))
    noise = np.array(seen)
    assert np.abs(noise.mean(axis=(0, 1))).max() < 0.05
    np.testing.assert_allclose(noise.std(axis=(0, 1)), 1, atol=0.03)
    assert np.abs(noise).max() <= 2 * np.sqrt(3)
    assert np.abs(np.corrcoef(noise.reshape(-1, 8).T) - np.eye(8)).max() < 0.05
    assert abs(np.corrcoef(noise[:-1].ravel(), noise[1:].ravel())[0, 1]) < 0.03


def test_noise_tells_nothing_of_the_plant_that_it_comes_from():
    simulator = simulator_with(**EVERYTHING)
    starts, goals = simulator.sample(np.random.default_rng(0), 4000)
    episodes, off = simulator.reset(starts, goals), []
    for _ in range(4):
        off.append(np.hstack([episodes.sensed[:, :5], episodes.observation[:, :3]]))
        simulator.step(episodes, np.zeros((4000, 5)))
    # With joints at rest, what changes from step to step is noise.
    changes = np.diff(off, axis=0).transpose(1, 0, 2).reshape(4000, -1)
    plants = episodes.plant[:, episodes.plant.std(axis=0) > 1e-12]
    together = np.corrcoef(np.hstack([changes, plants]).T)
    assert np.abs(together[: changes.shape[1], changes.shape[1] :]).max() < 0.1


def test_commanded_positions_are_seen_in_place_of_measured_ones():
    simulator = simulator_with(bandwidth=3.0, noise=0.1, feedback="commanded")
    starts, goals = simulator.sample(np.random.default_rng(0), 20)
    episodes = simulator.reset(starts, goals)
    for _ in range(3):
        simulator.step(episodes, np.full((20, 5), 0.5))
    told = starts[:, :5] + 1.5 * simulator.step_limit
    free = (episodes.status == 0) & (np.abs(told) < simulator.arm.upper[:5]).all(axis=1)
    np.testing.assert_allclose(episodes.sensed[free, :5], told[free], rtol=0, atol=1e-12)
    assert (episodes.q[free, :5] < told[free]).all()


@pytest.mark.parametrize("change", [{}, {"feedback": "commanded"}])
def test_rollouts_equal_the_reference(change):
    problem = ReachProblem.load("right").replace(tested_configurations=4)
    simulator = Simulator(problem, threads=1).with_plant(Plant(**{**EVERYTHING, **change}))
    rng = np.random.default_rng(3)
    starts, goals = simulator.sample(rng, 12)
    actions = held_actions(simulator, rng, 12)
    rollouts = simulator.rollout_actions(actions, starts, goals, record=True)
    reference, episodes = ReferenceSimulator(simulator), simulator.reset(starts, goals)
    seen = [episodes.observation.copy()]
    for step in range(64):
        simulator.step(episodes, actions[:, step])
        seen.append(episodes.observation.copy())
    for i in range(12):
        episode = reference.rollout(scripted(actions[i]), starts[i], goals[i])
        assert_equal_outcome(simulator, rollouts, i, episode)
        last = episode.observations[: len(episode.rewards) + (not episode.collision)]
        np.testing.assert_allclose([each[i] for each in seen[: len(last)]], last, atol=1e-12)


def test_episodes_that_go_on_keep_their_state():
    simulator = simulator_with(**EVERYTHING)
    starts, goals = simulator.sample(np.random.default_rng(6), 50)
    whole, actions = simulator.reset(starts, goals), np.full((50, 5), 0.2)
    for _ in range(4):
        simulator.step(whole, actions)
    going_on = {"origins": starts, "taken": whole.steps, "drive": whole.drive.copy()}
    later = simulator.reset(whole.q, goals, **going_on)
    running = whole.status == 0
    for _ in range(3):
        simulator.step(whole, actions)
        simulator.step(later, actions)
    np.testing.assert_array_equal(later.q[running], whole.q[running])
    np.testing.assert_array_equal(later.observation[running], whole.observation[running])


def test_ideal_plants_change_nothing():
    problem = ReachProblem.load("right")
    assert problem.replace(plant="ideal").digest == problem.digest
    assert Plant(feedback="commanded").ideal
    assert Plant(delay=(0, 0), bandwidth=(0.0, 0.0), acceleration=(0.0, 0.0)).ideal
    assert not Plant(delay=1).ideal


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"delay": 33}, "at most 32 steps"),
        ({"delay": (2, 1)}, "from low to high"),
        ({"bandwidth": (0.0, 5.0)}, "starts above 0"),
        ({"acceleration": 9.0}, "needs a bandwidth"),
        ({"acceleration": 9.0, "bandwidth": (0.0, 0.0)}, "needs a bandwidth"),
        ({"noise": -0.1}, "noise must not be negative"),
    ],
)
def test_settings_out_of_range_are_refused(settings, words):
    with pytest.raises(KinarmError, match=words):
        Plant(**settings)


def test_unknown_plants_are_named():
    with pytest.raises(KinarmError, match=r"unknown plant 'soft'.*hard"):
        ReachProblem.load("right").replace(plant="soft")
