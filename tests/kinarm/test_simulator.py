"""Rollouts and steps: semantics, determinism and refusals."""

import copy
import math
import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from simulators import changed

from kinarm.arm import Arm
from kinarm.envs import ReachEnv
from kinarm.episodes import COLLISION, TRUNCATED
from kinarm.errors import InvalidInputError, KinarmError, StartInContactError
from kinarm.kernels.rollout import advance, begin
from kinarm.kernels.screening import screen
from kinarm.networks import Layer, Mirror, Networks
from kinarm.problem import ReachProblem
from kinarm.recording import record_path
from kinarm.scene import Scene
from kinarm.simulator import Simulator
from tests.helpers.reference import ReferenceSimulator

HOME = np.zeros((1, 6))
FAR_GOAL = np.array([[0.0, 5.0, 5.0]])
RESULTS = ("success", "collision", "steps", "distance", "returns", "configurations", "targets")


def linear_policies(simulator, count, seed):
    rng = np.random.default_rng(seed)
    matrices = rng.normal(size=(count, simulator.n_actions, simulator.n_observations)) / 3
    return Networks((Layer(matrices, rng.normal(size=(count, simulator.n_actions)) / 10),))


def in_numpy(networks):
    weights, bias = (part[0] for part in networks.layers[0])
    return lambda x: x @ weights.T + bias


def assert_identical(first, second, rows=slice(None)):
    optional = [name for name in ("moments", "paths") if len(getattr(second, name))]
    for name in (*RESULTS, *optional):
        np.testing.assert_array_equal(getattr(first, name)[rows], getattr(second, name))


@pytest.fixture(scope="module")
def scenarios(simulator):
    return simulator.sample(np.random.default_rng(0), 600)


@pytest.fixture(scope="module")
def rewarded(simulator):
    """A simulator in which each reward term is non-zero."""
    weights = {"progress": 2.0, "closer": 0.125, "step": -0.25, "collision": -3.0, "success": 5.0}
    return changed(simulator, reward=weights)


class TestDeterminism:
    def test_threads_and_copies_do_not_matter(self, simulator, scenarios):
        networks = linear_policies(simulator, 600, 1)
        others = [Simulator(simulator.problem, threads=threads) for threads in (2, 3)]
        others += [pickle.loads(pickle.dumps(simulator)), copy.deepcopy(simulator)]
        first, *results = (
            each.rollout(networks, *scenarios, record=True, shift=np.ones(48))
            for each in (simulator, *others)
        )
        for found in results:
            assert_identical(first, found)
        assert first.collision.any()

    def test_batches_and_order_do_not_matter(self, simulator, scenarios):
        networks, (starts, goals) = linear_policies(simulator, 600, 2), scenarios
        settings = {"record": True, "shift": np.zeros(48)}
        whole = simulator.rollout(networks, starts, goals, **settings)
        order = np.random.default_rng(4).permutation(600)
        for rows in (slice(0, 1), slice(1, 100), slice(100, 600), order):
            index = np.arange(600)[rows]
            split = simulator.rollout(
                Networks((Layer(*(part[: index.max() + 1] for part in networks.layers[0])),)),
                starts[rows],
                goals[rows],
                policy_index=index,
                **settings,
            )
            assert_identical(whole, split, rows)


class TestAgreement:
    def test_step_loop_equals_replay(self, rewarded, scenarios):
        starts, goals = (part[:200] for part in scenarios)
        actions = np.random.default_rng(8).uniform(-1.5, 1.5, (200, 64, 5))
        replayed = rewarded.rollout_actions(actions, starts, goals, record=True)
        episodes = rewarded.reset(starts, goals, record=True)
        total, terminated = np.zeros(200), np.zeros(200, dtype=bool)
        for step in range(64):
            result = rewarded.step(episodes, actions[:, step])
            np.testing.assert_array_equal(result.reward, result.terms.sum(axis=1))
            total += result.reward
            terminated |= result.terminated
        np.testing.assert_array_equal(episodes.path, replayed.paths)
        np.testing.assert_array_equal(episodes.steps, replayed.steps)
        np.testing.assert_array_equal(episodes.distance, replayed.distance)
        np.testing.assert_array_equal(terminated, replayed.success | replayed.collision)
        np.testing.assert_allclose(total, replayed.returns, rtol=0, atol=1e-12)

    def test_function_equals_compiled_policy(self, simulator, scenarios):
        networks = linear_policies(simulator, 1, 9)
        compiled = simulator.rollout(networks, *scenarios, record=True)
        followed = simulator.rollout(in_numpy(networks), *scenarios, record=True)
        for name in (*RESULTS, "paths"):
            found, expected = getattr(followed, name), getattr(compiled, name)
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)

    def test_moments_are_sums_over_the_observations_acted_upon(self, simulator, scenarios):
        starts, goals = (part[:60] for part in scenarios)
        shift = np.random.default_rng(11).normal(size=48)
        rollouts = simulator.rollout(
            linear_policies(simulator, 60, 12), starts, goals, record=True, shift=shift
        )
        reference = ReferenceSimulator(simulator)
        assert rollouts.collision.any()
        for i in range(60):
            visited = rollouts.paths[i, : rollouts.steps[i]]
            seen = np.array([reference.observe(q, goals[i]) for q in visited]) - shift
            np.testing.assert_allclose(rollouts.moments[i, 0], seen.sum(axis=0), atol=1e-10)
            np.testing.assert_allclose(rollouts.moments[i, 1], (seen**2).sum(axis=0), atol=1e-10)


class TestStep:
    def test_reward_by_hand(self, rewarded):
        goal = np.array([[0.625, 1.0, 0.705]])
        episodes = rewarded.reset(HOME, goal)
        result = rewarded.step(episodes, [[1, 0, 0, 0, 0]])
        angle = math.radians(7)
        tool = 0.625 * np.array([math.cos(angle), math.sin(angle)])
        after = math.hypot(0.625 - tool[0], 1.0 - tool[1])
        assert result.terms[0].tolist() == [pytest.approx(2 * (1 - after)), 0.125, -0.25, 0, 0]
        assert result.reward[0] == pytest.approx(2 * (1.0 - after) + 0.125 - 0.25)

    def test_success_by_hand(self, rewarded):
        angle = math.radians(7)
        goal = np.array([[0.625 * math.cos(angle), 0.625 * math.sin(angle) + 0.01, 0.705]])
        episodes = rewarded.reset(HOME, goal)
        before = episodes.distance[0]
        result = rewarded.step(episodes, [[1, 0, 0, 0, 0]])
        assert (result.success[0], result.terminated[0], result.truncated[0]) == (True, True, False)
        assert result.reward[0] == pytest.approx(2 * (before - 0.01) + 0.125 + 5 - 0.25)

    def test_refused_move_leaves_the_arm_in_place(self, rewarded):
        episodes = rewarded.reset(HOME, FAR_GOAL)
        while episodes.status[0] != COLLISION:
            q, seen = episodes.q.copy(), episodes.observation.copy()
            result = rewarded.step(episodes, [[0, 1, 0, 0, 0]])
        np.testing.assert_array_equal(episodes.q, q)
        np.testing.assert_array_equal(episodes.observation, seen)
        assert (result.collision[0], result.terminated[0]) == (True, True)
        assert result.reward[0] == -3.25
        assert result.terms[0].tolist() == [0, 0, -0.25, -3, 0]

    def test_contact_beats_success(self, simulator):
        # The first refused move of a fall would end at this goal.
        path = simulator.reset(HOME, FAR_GOAL)
        while path.status[0] != COLLISION:
            simulator.step(path, [[0, 1, 0, 0, 0]])
        goal = simulator.arm.tool_position(path.target[0])
        assert np.linalg.norm(goal - simulator.arm.tool_position(path.q[0])) > 0.05
        episodes = simulator.reset(path.q, goal[None])
        result = simulator.step(episodes, [[0, 1, 0, 0, 0]])
        assert (result.collision[0], result.success[0]) == (True, False)

    def test_actions_are_clipped(self, simulator):
        ends = []
        for action in ([1, -1, 1, 0.5, 0], [7, -3, 1e9, 0.5, 0]):
            episodes = simulator.reset(HOME, FAR_GOAL)
            simulator.step(episodes, [action])
            ends.append(episodes.q[0])
        np.testing.assert_array_equal(ends[0], ends[1])
        np.testing.assert_allclose(np.rad2deg(ends[0]), [7, -7, 8, 4.5, 0, 0], atol=1e-12)

    def test_axes_stop_at_their_limits_and_held_ones_stay(self, simulator):
        start = HOME.copy()
        start[0, [0, 3, 5]] = simulator.arm.upper[0] - 0.01, simulator.arm.lower[3] + 0.02, 1.25
        episodes = simulator.reset(start, FAR_GOAL)
        simulator.step(episodes, [[1, 0, 0, -1, 0]])
        limits = simulator.arm.upper[0], simulator.arm.lower[3]
        np.testing.assert_array_equal(episodes.q[0, [0, 3, 5]], [*limits, 1.25])

    def test_horizon_truncates_what_is_no_success(self, simulator):
        for horizon in (1, 3):
            short = changed(simulator, horizon=horizon)
            episodes = short.reset(HOME, FAR_GOAL)
            results = [short.step(episodes, np.zeros((1, 5))) for _ in range(horizon)]
            flags = [bool(result.truncated[0]) for result in results]
            assert flags == [False] * (horizon - 1) + [True]
        short = changed(simulator, horizon=1, tolerance=0.5)
        result = short.step(short.reset(HOME, [[0.6, 0, 0.7]]), np.zeros((1, 5)))
        assert (result.success[0], result.truncated[0]) == (True, False)

    def test_ended_episodes_neither_move_nor_earn(self, rewarded):
        starts = np.zeros((2, 6))
        goals = np.array([[0.625, 0.08, 0.705], [0, 5, 5]])
        episodes = rewarded.reset(starts, goals)
        actions = np.array([[1.0, 0, 0, 0, 0]] * 2)
        assert rewarded.step(episodes, actions).success.tolist() == [True, False]
        resting = episodes.q[0].copy()
        result = rewarded.step(episodes, actions)
        np.testing.assert_array_equal(episodes.q[0], resting)
        assert not result.terminated[0]
        assert episodes.steps.tolist() == [1, 2]
        assert result.reward[0] == 0


def asked(simulator, policies=None, starts=HOME, goals=FAR_GOAL, **settings):
    """A rollout, of policies or on actions."""
    if isinstance(policies, np.ndarray):
        return simulator.rollout_actions(policies, starts, goals)
    policies = policies or linear_policies(simulator, 1, 0)
    return simulator.rollout(policies, starts, goals, **settings)


TWO = {"starts": np.zeros((2, 6)), "goals": np.tile(FAR_GOAL, (2, 1))}
THREE_POLICIES = Networks((Layer(np.zeros((3, 5, 48)), np.zeros((3, 5))),))


class TestRefusals:
    def test_start_in_contact_names_the_pair(self, simulator):
        starts = np.deg2rad([[0.0] * 6, [0, 110, -60, 0, 0, 0]])
        pair = simulator.world.contact_model.contact_pair(starts[1])
        message = f"start 1 is in contact: {pair[0]} touches {pair[1]}$"
        with pytest.raises(StartInContactError, match=message):
            asked(simulator, starts=starts, goals=np.tile(FAR_GOAL, (2, 1)))

    @pytest.mark.parametrize(
        ("given", "message"),
        [
            ({"starts": np.zeros((2, 5))}, r"starts must have shape \(n, 6\), got \(2, 5\)"),
            ({"starts": np.full((1, 6), 9.0)}, r"starts\[0\] lies outside the limits"),
            ({"goals": [[0, np.inf, 0]]}, r"goals must be finite, got inf at \[0, 1\]"),
            ({"goals": [[0, -1e200, 0]]}, r"goals must lie within 1e\+06 m, got 1e\+200"),
            ({"policies": np.zeros((1, 63, 5))}, r"actions must have shape \(1, 64, 5\)"),
            ({"policies": lambda _: np.full((1, 5), np.nan)}, "actions must be finite"),
            ({"policies": lambda _: HOME[:, :5], "policy_index": [0]}, "does not apply"),
            ({"policies": Networks((Layer(np.zeros((1, 5, 41)), np.zeros((1, 5))),))}, "41 observ"),
            ({"policies": THREE_POLICIES, **TWO}, "3 policies for 2 episodes: give policy_index"),
            *(
                ({"policies": THREE_POLICIES, **TWO, "policy_index": index}, r"2 .*0\.\.2")
                for index in ([0, 3], [-1, 0], [0])
            ),
            ({"shift": np.zeros(47)}, "shift"),
        ],
    )
    def test_of_rollouts(self, simulator, given, message):
        with pytest.raises(InvalidInputError, match=message):
            asked(simulator, **given)


def test_an_episode_whose_steps_are_all_taken_is_over(simulator):
    horizon, goals = simulator.task.horizon, np.tile(FAR_GOAL, (2, 1))
    taken = np.array([horizon, horizon - 1])
    episodes = simulator.reset(np.zeros((2, 6)), goals, record=True, taken=taken)
    for _ in range(2):
        result = simulator.step(episodes, np.zeros((2, 5)))
    np.testing.assert_array_equal(episodes.steps, horizon)
    assert (episodes.status == TRUNCATED).all()
    assert not result.truncated.any()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_what_rounding_puts_beyond_a_limit_is_clipped_everywhere(dtype):
    """As encoders and float32 do; farther out it is refused everywhere."""
    problem = ReachProblem.load("right")
    arm = problem.load_arm()
    joint = np.arange(6) == np.argmax(arm.upper.astype(np.float32) > arm.upper)
    limit = np.where(joint, arm.upper, 0.0)
    start = limit.astype(dtype) + (dtype == np.float64) * 1e-7 * joint
    assert (start > arm.upper).any()
    off = start + 1e-5 * joint
    goal, still = [[0, -0.5, 0.4]], lambda seen: np.zeros((len(seen), 5))
    simulator, env = Simulator(problem), ReachEnv(problem)

    def task_starts(given):
        return Simulator(problem.replace(starts=(tuple(map(float, given)),))).sample(
            np.random.default_rng(0), 1
        )[0][0]

    def home(given):
        return Arm.load(home=tuple(map(float, given))).home

    calls = [
        lambda given: simulator.rollout(still, [given], goal, record=True).configurations[0],
        lambda given: simulator.reset([given], goal).q[0],
        lambda given: env.reset(options={"start": given}) and env.episodes.q[0],
        lambda given: record_path(simulator.world, [given, limit]).states[0],
        task_starts,
        home,
    ]
    for call in calls:
        np.testing.assert_array_equal(np.asarray(call(start))[:6], limit)
        with pytest.raises(KinarmError, match="outside the limits: axis_"):
            call(off)
    assert len(simulator.world.inverse_kinematics([0.2, -0.5, 0.4], near=start))
    with pytest.raises(KinarmError, match="near lies outside the limits: axis_"):
        simulator.world.inverse_kinematics([0.2, -0.5, 0.4], near=off)


@pytest.mark.parametrize(("name", "doubtful"), [("paper", False), ("mesh", True)])
def test_coal_is_asked_only_where_nothing_is_proven(simulators, name, doubtful):
    simulator, rng = simulators[name], np.random.default_rng(27)
    starts, goals = simulator.sample(rng, 200)
    actions = rng.uniform(-1, 1, (200, simulator.task.horizon, simulator.n_actions))
    before = simulator.checked_by_coal
    assert simulator.rollout_actions(actions, starts, goals).collision.any()
    assert (simulator.checked_by_coal > before) == doubtful


class TestBatchesThatServeAgain:
    def test_rollouts_are_those_of_a_new_simulator(self, simulator):
        again, found, expected = Simulator(simulator.problem, threads=2), [], []
        for seed, n, count in ((1, 40, 1), (2, 40, 1), (3, 40, 40), (4, 7, 7)):
            scenarios = simulator.sample(np.random.default_rng(seed), n)
            networks = linear_policies(simulator, count, seed)
            for shift in (None, np.full(48, 0.1 * seed)):
                found.append(again.rollout(networks, *scenarios, shift=shift))
                new = Simulator(simulator.problem, threads=1)
                expected.append(new.rollout(networks, *scenarios, shift=shift))
        for first, second in zip(found, expected, strict=True):
            assert_identical(first, second)

    def test_networks_that_add_to_inverse_kinematics_are_no_others(self, scenarios):
        problem = ReachProblem.load("both").replace(observation=["goal", "resolved_rate"])
        simulator = Simulator(problem, threads=1)
        still = Networks((Layer(np.zeros((1, 5, 8)), np.zeros((1, 5))),))
        assert not simulator.rollout(still, *scenarios).success.any()
        adding = replace(still, rates=3)
        assert simulator.rollout(adding, *scenarios).success.mean() > 0.2

    def test_threads_may_use_one_simulator(self, simulator, scenarios):
        batches = [linear_policies(simulator, 1, seed) for seed in range(8)]
        with ThreadPoolExecutor(4) as pool:
            found = list(pool.map(lambda each: simulator.rollout(each, *scenarios), batches))
        for networks, rollouts in zip(batches, found, strict=True):
            assert_identical(rollouts, simulator.rollout(networks, *scenarios))


def test_kernels_are_compiled_once_for_all(simulators, scenarios):
    """Whatever the arm and the policy, and for copies, too."""
    mirror = Mirror(simulators["paper"].world.layout.signs(np.ones(6)), np.ones(5))
    for array in mirror[:2]:
        array.flags.writeable = False
    simulator = simulators["paper"]
    networks = linear_policies(simulator, 1, 26)
    simulator.rollout(networks, *scenarios)
    kernels = (advance, begin, screen)
    before = [len(kernel.signatures) for kernel in kernels]
    for policy in (networks, replace(networks, mirror=mirror), in_numpy(networks)):
        simulator.rollout(policy, *scenarios)
    for name, other in simulators.items():
        starts, goals = other.sample(np.random.default_rng(0), 5)
        other.rollout(linear_policies(other, 1, 27), starts, goals, record=name == "mesh")
    bare = changed(simulator, scene=Scene(obstacles=(), ground=False))
    bare.rollout(networks, HOME, FAR_GOAL)
    simulator.world.screen(np.asfortranarray(scenarios[0]))
    assert [len(kernel.signatures) for kernel in kernels] == before


def test_with_another_tolerance_it_is_as_if_built_so(simulator):
    other, built = simulator.changed(tolerance=0.3), changed(simulator, tolerance=0.3)
    assert other.problem == built.problem
    draws = [each.sample(np.random.default_rng(4), 60) for each in (other, built)]
    for first, second in zip(*draws, strict=True):
        np.testing.assert_array_equal(first, second)
    actions = np.random.default_rng(5).uniform(-1, 1, (60, 64, 5))
    found, expected, plain = (
        each.rollout_actions(actions, *draws[0]) for each in (other, built, simulator)
    )
    assert_identical(found, expected)
    assert found.success.sum() > plain.success.sum()
