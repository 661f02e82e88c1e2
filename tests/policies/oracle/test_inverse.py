"""Inverse kinematics: what is found is a solution, and what there is is found."""

import itertools

import numpy as np
import pytest
from proofs import aims_at, projected

from kinarm.arm import Arm
from kinarm.kernels.records import recorded
from kinarm.policies.oracle import motion_search
from kinarm.policies.oracle.goals import Stage
from kinarm.policies.oracle.inverse import solve_within, step_box, steps_between
from kinarm.policies.oracle.kernels.projection import damped_least_squares, layout
from kinarm.policies.oracle.motion_search import MotionSearch
from kinarm.problem import PROBLEMS
from kinarm.simulator import Simulator

SHIPPED = ("lrmate200ic_5l", "paper", "paper_flange")


def tool_distances(simulator, configurations, goal):
    tools = np.array([simulator.arm.tool_position(q) for q in configurations]).reshape(-1, 3)
    return np.linalg.norm(tools - goal, axis=1)


@pytest.fixture(scope="module")
def planar(make_joint, write_robot):
    """Two links of 0.5 m and 0.3 m in a horizontal plane, without shapes."""
    limit = '<limit lower="-2.8" upper="2.8" velocity="5" effort="0"/>'
    joints = [make_joint(xyz="0 0 0.4", limit=limit), make_joint(xyz="0.5 0 0", limit=limit)]
    arm = Arm.load(write_robot(joints, tool="0.3 0 0"))
    return Simulator(PROBLEMS["left"].replace(arm=arm, tolerance=1e-3), threads=1)


def elbow_solutions(goal):
    """Both configurations of the planar arm that put the tool at a point of the plane."""
    radius, angle = np.hypot(goal[0], goal[1]), np.arctan2(goal[1], goal[0])
    bend = np.arccos((radius**2 - 0.5**2 - 0.3**2) / (2 * 0.5 * 0.3))
    lead = np.arctan2(0.3 * np.sin(bend), 0.5 + 0.3 * np.cos(bend))
    return np.array([[angle - lead, bend], [angle + lead, -bend]])


class TestEndsOfDetours:
    @pytest.fixture
    def ends(self, monkeypatch):
        """What a search for detours from a start to a goal would end at."""

        def found(simulator, start, goal):
            asked = []
            monkeypatch.setattr(motion_search, "find_path", lambda *given: asked.append(given[2]))
            MotionSearch(simulator, start[None], Stage(goal[None])).try_detours(np.arange(1))
            return asked[0] if asked else np.empty((0, len(start)))

        return found

    @pytest.mark.parametrize("name", SHIPPED)
    def test_are_solutions_the_soonest_first_and_apart(self, simulators, name, ends):
        simulator = simulators[name]
        arm, n = simulator.arm, simulator.n_actions
        counts = []
        for start, goal in zip(*simulator.sample(np.random.default_rng(1), 12), strict=True):
            found = ends(simulator, start, goal)
            counts.append(len(found))
            assert ((found >= arm.lower) & (found <= arm.upper)).all()
            np.testing.assert_array_equal(found[:, n:], np.tile(start[n:], (len(found), 1)))
            assert (tool_distances(simulator, found, goal) <= simulator.task.tolerance).all()
            assert not simulator.world.contact_model.in_contact(found).any()
            steps = steps_between(simulator, start, found)
            assert (np.diff(steps) >= 0).all()
            assert (steps <= simulator.task.horizon + 1e-9).all()
            for first, second in itertools.combinations(found, 2):
                assert np.abs(first - second).max() > 0.2
        assert np.median(counts) > 10

    def test_horizon_limits_them(self, ends):
        simulator = Simulator(PROBLEMS["right"].replace(horizon=6), threads=1)
        near, far = (
            simulator.arm.tool_position([first, 0.1, 0.1, 0, 0.2, 0]) for first in (0.4, 2.0)
        )
        assert len(ends(simulator, np.zeros(6), near)) > 0
        assert len(ends(simulator, np.zeros(6), far)) == 0


class TestSolveWithin:
    def test_lies_throughout_the_tolerance(self, simulator):
        starts, goals = simulator.sample(np.random.default_rng(2), 10)
        steps, tolerances = np.full(10, 64), np.full(10, simulator.task.tolerance)
        found = solve_within(simulator, starts, goals, steps, tolerances, starts, 256)
        away = tool_distances(simulator, found.configurations, goals[found.owner])
        shares = away / simulator.task.tolerance
        assert (shares < 0.5).sum() > 3
        assert (shares > 0.8).sum() > 30
        assert 0.99 < shares.max() <= 1.0

    def test_finds_both_elbows_of_a_planar_arm(self, planar):
        rng = np.random.default_rng(3)
        angle, radius = rng.uniform(-1.8, 1.8, 20), rng.uniform(0.35, 0.75, 20)
        goals = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(20, 0.4)])
        starts, steps = np.zeros((20, 2)), np.full(20, 64)
        found = solve_within(planar, starts, goals, steps, np.full(20, 1e-3), starts, 64)
        for row, goal in enumerate(goals):
            solutions = found.configurations[found.owner == row]
            apart = solutions[:, None] - elbow_solutions(goal)
            assert (np.abs(apart).max(axis=2).min(axis=0) < 0.02).all()
            assert (np.abs(apart).max(axis=2).min(axis=1) < 0.02).all()

    def test_keeps_to_boxes_tolerances_and_owners(self, simulator):
        starts, goals = simulator.sample(np.random.default_rng(5), 20)
        steps, tolerances = np.arange(10, 50, 2), np.linspace(0.02, 0.2, 20)
        found = solve_within(simulator, starts, goals, steps, tolerances, starts, 64)
        assert (np.diff(found.owner) >= 0).all()
        assert len(set(found.owner)) > 10
        lower, upper = step_box(simulator, starts, steps)
        for row, (q, owner) in enumerate(zip(found.configurations, found.owner, strict=True)):
            assert (q[:5] >= lower[owner]).all(), row
            assert (q[:5] <= upper[owner]).all()
            away = np.linalg.norm(simulator.arm.tool_position(q) - goals[owner])
            assert away <= tolerances[owner]
        assert not simulator.world.contact_model.in_contact(found.configurations).any()

    def test_goals_are_treated_alone(self, simulator):
        starts, goals = simulator.sample(np.random.default_rng(6), 6)
        steps, tolerances = np.full(6, 40), np.full(6, 0.05)
        found = solve_within(simulator, starts, goals, steps, tolerances, starts, 32)
        for i in range(6):
            one = slice(i, i + 1)
            parts = (starts[one], goals[one], steps[one], tolerances[one], starts[one])
            alone = solve_within(simulator, *parts, 32)
            np.testing.assert_array_equal(
                alone.configurations, found.configurations[found.owner == i]
            )

    def test_the_guess_counts(self, planar):
        # The best of few samples: two of them are the start and the guess.
        goal, start = np.array([[0.2, 0.5, 0.4]]), np.zeros((1, 2))
        guess = elbow_solutions(goal[0])[:1]
        found = solve_within(
            planar, start, goal, np.array([64]), np.array([1e-3]), guess, 2
        ).configurations
        assert np.abs(found - guess).max(axis=1).min() < 1e-12


class TestProject:
    def test_reports_true_distances_within_the_box(self, any_simulator):
        simulator, n = any_simulator, any_simulator.n_actions
        arm, rng = simulator.arm, np.random.default_rng(7)
        starts = rng.uniform(arm.lower, arm.upper, (100, arm.n_joints))
        goals = np.array([arm.tool_position(q) for q in rng.permutation(starts)[:10]])
        lower, upper = step_box(simulator, starts[:10], np.full(10, 30))
        owner = np.arange(100) % 10
        begun = starts.copy()
        begun[:, :n] = np.clip(begun[:, :n], lower[owner], upper[owner])
        ended, distances = projected(
            simulator, begun, owner, (lower, upper), aims_at(simulator, goals), np.full(100, 0.02)
        )
        np.testing.assert_array_equal(ended[:, n:], begun[:, n:])
        assert (ended[:, :n] >= lower[owner]).all()
        assert (ended[:, :n] <= upper[owner]).all()
        for q, goal, distance in zip(ended, goals[owner], distances, strict=True):
            away = np.linalg.norm(arm.tool_position(q) - goal)
            assert distance == pytest.approx(away, abs=1e-12)
        before = np.linalg.norm(
            [arm.tool_position(q) - goal for q, goal in zip(begun, goals[owner], strict=True)],
            axis=1,
        )
        assert np.median(distances) < np.median(before)

    def test_reaches_what_can_be_reached(self, simulator):
        rng, arm = np.random.default_rng(9), simulator.arm
        begun = rng.uniform(arm.lower, arm.upper, (400, 6))
        goals = np.array([arm.tool_position(q) for q in rng.uniform(arm.lower, arm.upper, (4, 6))])
        box = tuple(np.tile(limit[:5], (4, 1)) for limit in (arm.lower, arm.upper))
        owner = np.arange(400) % 4
        aims = aims_at(simulator, goals)
        _, distances = projected(simulator, begun, owner, box, aims, np.full(400, 1e-4))
        assert (distances <= 1e-4).mean() > 0.5


class TestLanes:
    """Rows share the lanes of a block, and make room for the next ones."""

    @pytest.fixture
    def rows(self, any_simulator):
        simulator, arm = any_simulator, any_simulator.arm
        rng, n = np.random.default_rng(20), simulator.n_actions
        begun = rng.uniform(arm.lower, arm.upper, (90, arm.n_joints))
        goals = np.array([arm.tool_position(q) for q in begun[:9]])
        box = step_box(simulator, begun[:9], rng.integers(5, 60, 9))
        owner = rng.integers(0, 9, 90)
        begun[:, :n] = np.clip(begun[:, :n], box[0][owner], box[1][owner])
        # Some have arrived where they begin, some never do.
        aims = aims_at(simulator, goals)
        return begun, owner, box, aims, rng.choice([0.0, 1e-3, 0.05, 5.0], 90)

    def test_the_company_does_not_matter(self, any_simulator, rows):
        begun, owner, box, aims, radius = rows
        ended, distances = projected(any_simulator, begun, owner, box, aims, radius)
        assert np.isfinite(ended).all()
        assert np.isfinite(distances).all()
        order = np.random.default_rng(21).permutation(90)
        for some in (*np.split(order, [1, 3, 10, 17, 25, 42]), order, np.arange(0)):
            one, other = projected(any_simulator, begun[some], owner[some], box, aims, radius[some])
            np.testing.assert_array_equal(one, ended[some])
            np.testing.assert_array_equal(other, distances[some])

    def test_other_rows_are_left_alone(self, any_simulator, rows):
        begun, owner, box, aims, radius = rows
        ended, distances = begun.copy(), np.full(90, -1.0)
        chain, moving = any_simulator.world.records[0], layout(begun.shape[1], box[0].shape[1], 0)
        aimed = (aims.position, recorded(aims.turn), aims.wanted)
        arrays = (owner, *box, *aimed, radius, ended, distances)
        damped_least_squares(20, 31, moving.record(), chain, *arrays)
        expected, away = projected(any_simulator, begun, owner, box, aims, radius)
        moved = np.isin(np.arange(90), np.arange(20, 31))
        np.testing.assert_array_equal(ended, np.where(moved[:, None], expected, begun))
        np.testing.assert_array_equal(distances, np.where(moved, away, -1.0))


def test_step_box_by_hand(simulator):
    starts = np.array([[0.0, 2.4, -1.2, 0, 0, 5], [3.1, 0, 0, 0, 0, 0]])
    lower, upper = step_box(simulator, starts, np.array([2, 3]))
    # Two steps of 7, 7, 8, 9 and 9 degrees, then three; limits of 180, 140 and -72 degrees.
    moves = np.deg2rad([[14, 14, 16, 18, 18], [21, 21, 24, 27, 27]])
    expected_lower, expected_upper = starts[:, :5] - moves, starts[:, :5] + moves
    expected_lower[0, 2] = np.deg2rad(-72)
    expected_upper[0, 1] = np.deg2rad(140)
    expected_upper[1, 0] = np.pi
    np.testing.assert_allclose(lower, expected_lower, atol=1e-12)
    np.testing.assert_allclose(upper, expected_upper, atol=1e-12)
