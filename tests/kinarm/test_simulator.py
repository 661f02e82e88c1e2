"""Rollouts and steps: semantics, determinism and refusals."""

import copy
import math
import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from simulators import changed

from kinarm.episodes import COLLISION, RUNNING
from kinarm.errors import InvalidInputError, StartInContactError
from kinarm.kernels.rollout import advance, begin
from kinarm.kernels.screening import screen
from kinarm.networks import Mirror, Networks
from kinarm.observation import observation_signs
from kinarm.problem import PROBLEMS
from kinarm.reference import ReferenceSimulator
from kinarm.scene import Scene
from kinarm.simulator import Simulator
from kinarm.task import REWARD_TERMS

HOME = np.zeros((1, 6))
FAR_GOAL = np.array([[0.0, 5.0, 5.0]])
RESULTS = ("success", "collision", "steps", "distance", "returns", "configurations", "targets")


def linear_policies(simulator, count, seed):
    rng = np.random.default_rng(seed)
    matrices = rng.normal(size=(count, simulator.n_actions, simulator.n_observations)) / 3
    return Networks.linear(matrices, rng.normal(size=(count, simulator.n_actions)) / 10)


def in_numpy(networks):
    """A linear network as a Python function."""
    n_in, n_out = networks.layers
    weights = networks.weights[0, :-n_out].reshape(n_in, n_out)
    return lambda x: x @ weights + networks.weights[0, -n_out:]


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
    def test_threads_do_not_matter(self, simulator, scenarios):
        networks = linear_policies(simulator, 600, 1)
        results = [
            Simulator(simulator.problem, threads=threads).rollout(
                networks, *scenarios, record=True, shift=np.ones(48)
            )
            for threads in (1, 2, 3)
        ]
        assert_identical(results[0], results[1])
        assert_identical(results[0], results[2])
        assert results[0].collision.any()

    def test_batch_split_does_not_matter(self, simulator, scenarios):
        networks, (starts, goals) = linear_policies(simulator, 600, 2), scenarios
        settings = {"record": True, "shift": np.zeros(48)}
        whole = simulator.rollout(networks, starts, goals, **settings)
        for rows in (slice(0, 1), slice(1, 100), slice(100, 600)):
            part = Networks(networks.layers, networks.weights[rows])
            split = simulator.rollout(part, starts[rows], goals[rows], **settings)
            assert_identical(whole, split, rows)

    def test_order_does_not_matter(self, simulator, scenarios):
        networks, (starts, goals) = linear_policies(simulator, 600, 3), scenarios
        order = np.random.default_rng(4).permutation(600)
        whole = simulator.rollout(networks, starts, goals, record=True)
        shuffled = simulator.rollout(
            networks, starts[order], goals[order], policy_index=order, record=True
        )
        assert_identical(whole, shuffled, order)

    def test_threads_do_not_change_what_is_drawn(self, simulator):
        draws = [
            Simulator(simulator.problem, threads=threads).sample(np.random.default_rng(5), 3000)
            for threads in (1, 2)
        ]
        np.testing.assert_array_equal(draws[0][0], draws[1][0])
        np.testing.assert_array_equal(draws[0][1], draws[1][1])

    def test_copies_behave_alike(self, simulator, scenarios):
        networks = linear_policies(simulator, 1, 6)
        expected = simulator.rollout(networks, *scenarios)
        for other in (pickle.loads(pickle.dumps(simulator)), copy.deepcopy(simulator)):
            assert_identical(expected, other.rollout(networks, *scenarios))

    def test_inputs_are_left_alone(self, simulator, scenarios):
        starts, goals = (part.copy() for part in scenarios)
        result = simulator.rollout(linear_policies(simulator, 1, 7), starts, goals)
        np.testing.assert_array_equal(starts, scenarios[0])
        np.testing.assert_array_equal(goals, scenarios[1])
        starts[:] = 9
        np.testing.assert_array_equal(result.starts, scenarios[0])


class TestAgreement:
    def test_step_loop_equals_replay(self, simulator, scenarios):
        starts, goals = (part[:200] for part in scenarios)
        actions = np.random.default_rng(8).uniform(-1.5, 1.5, (200, 64, 5))
        replayed = simulator.rollout_actions(actions, starts, goals, record=True)
        episodes = simulator.reset(starts, goals, record=True)
        total, terminated = np.zeros(200), np.zeros(200, dtype=bool)
        for step in range(64):
            running = episodes.status == RUNNING
            result = simulator.step(episodes, actions[:, step])
            total[running] += result.reward[running]
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
        for name in ("success", "collision", "steps"):
            np.testing.assert_array_equal(getattr(compiled, name), getattr(followed, name))
        for name in ("paths", "distance", "returns", "configurations"):
            np.testing.assert_allclose(
                getattr(compiled, name), getattr(followed, name), rtol=0, atol=1e-12
            )

    def test_policy_index_chooses_the_policy(self, simulator, scenarios):
        networks = linear_policies(simulator, 3, 10)
        index = np.arange(600) % 3
        mixed = simulator.rollout(networks, *scenarios, policy_index=index)
        for k in range(3):
            alone = Networks(networks.layers, networks.weights[k : k + 1])
            expected = simulator.rollout(alone, *scenarios)
            np.testing.assert_array_equal(mixed.returns[k::3], expected.returns[k::3])

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
            seen = np.array([reference.observe(q, goals[i])[0] for q in visited]) - shift
            np.testing.assert_allclose(rollouts.moments[i, 0], seen.sum(axis=0), atol=1e-10)
            np.testing.assert_allclose(rollouts.moments[i, 1], (seen**2).sum(axis=0), atol=1e-10)

    def test_rewards_sum_to_the_return(self, rewarded):
        rng = np.random.default_rng(13)
        starts, goals = rewarded.sample(rng, 100)
        episodes = rewarded.reset(starts, goals)
        total = np.zeros(100)
        for _ in range(64):
            running = episodes.status == RUNNING
            result = rewarded.step(episodes, rng.uniform(-1, 1, (100, 5)))
            np.testing.assert_array_equal(result.reward, result.terms.sum(axis=1))
            total += np.where(running, result.reward, 0)
        np.testing.assert_allclose(total, episodes.total, atol=1e-12)

    def test_contact_pairs_name_what_was_hit(self, simulator, scenarios):
        rollouts = simulator.rollout(linear_policies(simulator, 600, 14), *scenarios)
        pairs = simulator.contact_pairs(rollouts)
        assert [pair is not None for pair in pairs] == rollouts.collision.tolist()
        assert set(pairs) - {None} <= set(simulator.world.contact_model.pair_names)


class TestStep:
    def test_reward_by_hand(self, rewarded):
        goal = np.array([[0.625, 1.0, 0.705]])
        episodes = rewarded.reset(HOME, goal)
        result = rewarded.step(episodes, [[1, 0, 0, 0, 0]])
        angle = math.radians(7)
        tool = 0.625 * np.array([math.cos(angle), math.sin(angle)])
        after = math.hypot(0.625 - tool[0], 1.0 - tool[1])
        terms = dict(zip(REWARD_TERMS, result.terms[0], strict=True))
        assert terms == {
            "progress": pytest.approx(2 * (1.0 - after)),
            "closer": 0.125,
            "step": -0.25,
            "collision": 0,
            "success": 0,
        }
        assert result.reward[0] == pytest.approx(2 * (1.0 - after) + 0.125 - 0.25)

    def test_success_by_hand(self, rewarded):
        angle = math.radians(7)
        goal = np.array([[0.625 * math.cos(angle), 0.625 * math.sin(angle) + 0.01, 0.705]])
        episodes = rewarded.reset(HOME, goal)
        before = episodes.distance[0]
        result = rewarded.step(episodes, [[1, 0, 0, 0, 0]])
        assert result.success[0]
        assert result.terminated[0]
        assert not result.truncated[0]
        assert result.reward[0] == pytest.approx(2 * (before - 0.01) + 0.125 + 5 - 0.25)

    def test_refused_move_leaves_the_arm_in_place(self, rewarded):
        episodes = rewarded.reset(HOME, FAR_GOAL)
        while episodes.status[0] != COLLISION:
            q, seen = episodes.q.copy(), episodes.observation.copy()
            result = rewarded.step(episodes, [[0, 1, 0, 0, 0]])
        np.testing.assert_array_equal(episodes.q, q)
        np.testing.assert_array_equal(episodes.observation, seen)
        assert result.collision[0]
        assert result.terminated[0]
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
        assert result.collision[0]
        assert not result.success[0]

    def test_actions_are_clipped(self, simulator):
        ends = []
        for action in ([1, -1, 1, 0.5, 0], [7, -3, 1e9, 0.5, 0]):
            episodes = simulator.reset(HOME, FAR_GOAL)
            simulator.step(episodes, [action])
            ends.append(episodes.q[0])
        np.testing.assert_array_equal(ends[0], ends[1])
        np.testing.assert_allclose(np.rad2deg(ends[0]), [7, -7, 8, 4.5, 0, 0], atol=1e-12)

    def test_axes_stop_at_their_limits(self, simulator):
        start = HOME.copy()
        start[0, 0] = simulator.arm.upper[0] - 0.01
        start[0, 3] = simulator.arm.lower[3] + 0.02
        episodes = simulator.reset(start, FAR_GOAL)
        simulator.step(episodes, [[1, 0, 0, -1, 0]])
        assert episodes.q[0, 0] == simulator.arm.upper[0]
        assert episodes.q[0, 3] == simulator.arm.lower[3]

    def test_held_axis_stays_where_it_starts(self, simulator):
        start = HOME.copy()
        start[0, 5] = 1.25
        rollouts = simulator.rollout_actions(np.ones((1, 64, 5)), start, FAR_GOAL, record=True)
        np.testing.assert_array_equal(rollouts.paths[0, : rollouts.steps[0] + 1, 5], 1.25)

    def test_horizon_truncates(self, simulator):
        for horizon in (1, 3):
            short = changed(simulator, horizon=horizon)
            episodes = short.reset(HOME, FAR_GOAL)
            flags = [
                bool(short.step(episodes, np.zeros((1, 5))).truncated[0]) for _ in range(horizon)
            ]
            assert flags == [False] * (horizon - 1) + [True]
            rollouts = short.rollout(lambda x: np.zeros((len(x), 5)), HOME, FAR_GOAL)
            assert rollouts.steps[0] == horizon
            assert not rollouts.success[0]
            assert not rollouts.collision[0]

    def test_success_at_the_horizon_is_no_truncation(self, simulator):
        short = changed(simulator, horizon=1, tolerance=0.5)
        result = short.step(short.reset(HOME, [[0.6, 0, 0.7]]), np.zeros((1, 5)))
        assert result.success[0]
        assert not result.truncated[0]

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

    def test_time_step_scales_the_motion(self, simulator):
        slow = changed(simulator, time_step=0.01)
        np.testing.assert_allclose(slow.step_limit, simulator.step_limit / 2)
        np.testing.assert_allclose(np.rad2deg(simulator.step_limit), [7, 7, 8, 9, 9])


def asked(simulator, policies=None, starts=HOME, goals=FAR_GOAL, **settings):
    """A rollout, of policies or on actions."""
    if isinstance(policies, np.ndarray):
        return simulator.rollout_actions(policies, starts, goals)
    return simulator.rollout(
        policies or linear_policies(simulator, 1, 0), starts, goals, **settings
    )


TWO = {"starts": np.zeros((2, 6)), "goals": np.tile(FAR_GOAL, (2, 1))}
THREE_POLICIES = Networks.linear(np.zeros((3, 5, 48)), np.zeros((3, 5)))


class TestRefusals:
    def test_start_in_contact_names_the_pair(self, simulator):
        starts = np.zeros((3, 6))
        starts[1] = np.deg2rad([0, 110, -60, 0, 0, 0])
        pair = simulator.world.contact_model.contact_pair(starts[1])
        with pytest.raises(StartInContactError) as caught:
            asked(simulator, starts=starts, goals=np.tile(FAR_GOAL, (3, 1)))
        assert caught.value.index == 1
        assert caught.value.pair == pair
        assert f"start 1 is in contact: {pair[0]} touches {pair[1]}" in str(caught.value)

    @pytest.mark.parametrize("axis", range(6))
    def test_start_beyond_the_limits(self, simulator, axis):
        starts = np.zeros((2, 6))
        starts[1, axis] = simulator.arm.upper[axis] + 1e-9
        with pytest.raises(InvalidInputError, match="start 1 lies outside the limits"):
            simulator.reset(starts, np.tile(FAR_GOAL, (2, 1)))

    @pytest.mark.parametrize(
        ("given", "message"),
        [
            ({"starts": np.zeros((2, 5))}, r"starts must have shape \(n, 6\), got \(2, 5\)"),
            ({"starts": np.zeros(6)}, "starts must have shape"),
            ({"starts": np.full((1, 6), np.nan)}, "starts must be finite, got nan at"),
            ({"starts": [["a"] * 6]}, "starts must be numbers"),
            ({"goals": np.ones((3, 3))}, r"goals must have shape \(1, 3\), got \(3, 3\)"),
            ({"goals": np.ones((1, 2))}, "goals must have shape"),
            ({"goals": [[0, np.inf, 0]]}, r"goals must be finite, got inf at \[0, 1\]"),
            ({"policies": np.zeros((1, 63, 5))}, r"actions must have shape \(1, 64, 5\)"),
            ({"policies": np.full((1, 64, 5), np.inf)}, "actions must be finite"),
            ({"policies": lambda _: np.full((1, 5), np.nan)}, "actions must be finite"),
            ({"policies": lambda _: HOME[:, :5], "policy_index": [0]}, "does not apply"),
            ({"policies": Networks.linear(np.zeros((1, 5, 41)), np.zeros((1, 5)))}, "41 observ"),
            ({"policies": THREE_POLICIES, **TWO}, "3 policies for 2 episodes: give policy_index"),
            *(
                ({"policies": THREE_POLICIES, **TWO, "policy_index": index}, r"2 .*0\.\.2")
                for index in ([0, 3], [-1, 0], [0], [[0, 1]], [0.5, 1.0], ["a", "b"])
            ),
            ({"shift": np.zeros(47)}, "shift"),
            ({"shift": np.full(48, np.nan)}, "shift"),
        ],
    )
    def test_of_rollouts(self, simulator, given, message):
        with pytest.raises(InvalidInputError, match=message):
            asked(simulator, **given)
        if given.keys() <= {"starts", "goals"}:
            with pytest.raises(InvalidInputError, match=message):
                simulator.reset(**{"starts": HOME, "goals": FAR_GOAL} | given)

    @pytest.mark.parametrize("shape", [(5,), (1, 6), (2, 5), (1, 1, 5)])
    def test_actions_of_the_wrong_shape(self, simulator, shape):
        with pytest.raises(InvalidInputError, match=r"actions must have shape \(1, 5\)"):
            simulator.step(simulator.reset(HOME, FAR_GOAL), np.zeros(shape))

    @pytest.mark.parametrize("bad", [np.nan, np.inf])
    def test_actions_that_are_not_finite(self, simulator, bad):
        with pytest.raises(InvalidInputError, match="actions must be finite"):
            simulator.step(simulator.reset(HOME, FAR_GOAL), np.array([[0, 0, bad, 0, 0]]))

    @pytest.mark.parametrize("threads", [0, -1])
    def test_bad_threads(self, simulator, threads):
        with pytest.raises(InvalidInputError, match="threads must be a whole number of at least 1"):
            Simulator("right", threads=threads)

    @pytest.mark.parametrize("part", ["problem", "task", "arm", "scene", "n_actions"])
    def test_simulator_and_problem_cannot_drift_apart(self, simulator, part):
        with pytest.raises(AttributeError):
            setattr(simulator, part, None)


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
        again = Simulator(simulator.problem, threads=2)
        for seed, n, count in ((1, 40, 1), (2, 40, 1), (3, 40, 40), (4, 40, 40), (5, 7, 7)):
            scenarios = simulator.sample(np.random.default_rng(seed), n)
            networks, shift = linear_policies(simulator, count, seed), np.full(48, 0.1 * seed)
            kept = networks.weights.copy()
            for moved in (None, shift):
                found = again.rollout(networks, *scenarios, shift=moved)
                expected = Simulator(simulator.problem, threads=1).rollout(
                    networks, *scenarios, shift=moved
                )
                assert_identical(found, expected)
            np.testing.assert_array_equal(networks.weights, kept)

    def test_threads_may_use_one_simulator(self, simulator, scenarios):
        batches = [linear_policies(simulator, 1, seed) for seed in range(8)]
        with ThreadPoolExecutor(4) as pool:
            found = list(pool.map(lambda each: simulator.rollout(each, *scenarios), batches))
        for networks, rollouts in zip(batches, found, strict=True):
            assert_identical(rollouts, simulator.rollout(networks, *scenarios))

    def test_outcomes_stay_as_they_were(self, simulator, scenarios):
        first = simulator.rollout(linear_policies(simulator, 1, 1), *scenarios)
        kept = first.returns.copy(), first.configurations.copy()
        simulator.rollout(linear_policies(simulator, 1, 2), *scenarios)
        np.testing.assert_array_equal(first.returns, kept[0])
        np.testing.assert_array_equal(first.configurations, kept[1])


def test_kernels_are_compiled_once_for_all(simulators, scenarios):
    """Whatever the arm and the policy, and for copies, too."""
    mirror = Mirror(observation_signs(6), np.ones(5))
    for array in mirror:
        array.flags.writeable = False
    simulator = simulators["paper"]
    networks = linear_policies(simulator, 1, 26)
    simulator.rollout(networks, *scenarios)
    kernels = (advance, begin, screen)
    before = [len(kernel.signatures) for kernel in kernels]
    for policy in (networks, replace(networks, mirror=mirror), in_numpy(networks)):
        simulator.rollout(policy, *scenarios)
    for other in (pickle.loads(pickle.dumps(simulator)), copy.deepcopy(simulator)):
        other.rollout(networks, *scenarios)
    for name, other in simulators.items():
        starts, goals = other.sample(np.random.default_rng(0), 5)
        other.rollout(linear_policies(other, 1, 27), starts, goals, record=name == "mesh")
    bare = changed(simulator, scene=Scene(obstacles=(), ground=False))
    bare.rollout(networks, HOME, FAR_GOAL)
    simulator.world.screen(np.asfortranarray(scenarios[0]))
    assert [len(kernel.signatures) for kernel in kernels] == before


@pytest.mark.parametrize("n", [0, 7])
def test_rollouts_know_their_length(simulator, scenarios, n):
    assert len(asked(simulator, starts=scenarios[0][:n], goals=scenarios[1][:n])) == n


def test_list_of_policies(simulator, scenarios):
    class Wrapped:
        def __init__(self, networks):
            self._networks = networks

        def networks(self):
            return self._networks

    networks = linear_policies(simulator, 600, 25)
    listed = [Wrapped(Networks(networks.layers, row[None])) for row in networks.weights]
    assert_identical(simulator.rollout(networks, *scenarios), simulator.rollout(listed, *scenarios))


def test_with_another_tolerance_it_is_as_if_built_so():
    simulator = Simulator("right", threads=1)
    other, built = (
        simulator.with_tolerance(0.3),
        Simulator(PROBLEMS["right"].replace(tolerance=0.3), threads=1),
    )
    assert other.problem == built.problem
    draws = [each.sample(np.random.default_rng(4), 60) for each in (other, built)]
    for first, second in zip(*draws, strict=True):
        np.testing.assert_array_equal(first, second)
    actions = np.random.default_rng(5).uniform(-1, 1, (60, 64, 5))
    found, expected, plain = (
        each.rollout_actions(actions, *draws[0]) for each in (other, built, simulator)
    )
    np.testing.assert_array_equal(found.steps, expected.steps)
    np.testing.assert_array_equal(found.success, expected.success)
    assert found.success.sum() > plain.success.sum()


def test_a_step_tells_the_distance_from_the_tool_to_the_goal(simulator, scenarios):
    """Against Pinocchio."""
    starts, goals = (part[:20] for part in scenarios)
    episodes = simulator.reset(starts, goals)
    result = simulator.step(episodes, np.full((20, 5), 0.3))
    tools = np.array([simulator.arm.tool_position(q) for q in episodes.q])
    expected = np.linalg.norm(tools - goals, axis=1)
    np.testing.assert_allclose(result.distance, expected, atol=1e-12)
