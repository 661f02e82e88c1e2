"""Motions as tables of actions: where they lead, how fast, and when they rest."""

import itertools

import numpy as np
import pytest

from kinarm.arm import Arm
from kinarm.policies.oracle.inverse import steps_between
from kinarm.policies.oracle.motion_search import along_path, two_segments
from kinarm.problem import PROBLEMS
from kinarm.scene import Scene
from kinarm.simulator import Simulator

FAR = np.array([0.0, 0.0, 90.0])
LIMITS = np.array([0.06, 0.02, 0.06])
"""Largest moves in a step: 3 rad/s, 1 m/s and 3 rad/s for 0.02 s."""


@pytest.fixture(scope="module")
def free(make_joint, write_robot):
    """An arm without shapes: a turn, a slide, a turn, and a last axis that is not actuated."""
    slide = make_joint(
        "prismatic",
        axis="1 0 0",
        limit='<limit lower="-0.4" upper="0.5" velocity="1" effort="0"/>',
    )
    joints = [make_joint(), slide, make_joint(xyz="0.3 0 0", axis="0 1 0"), make_joint()]
    arm = Arm.load(write_robot(joints, tool="0 0 0.2"))
    scene = Scene(obstacles=(), ground=False)
    return Simulator(PROBLEMS["left"].replace(arm=arm, scene=scene, tolerance=1e-6), threads=1)


def drawn(simulator, seed, count, last=0.4):
    """Random configurations; the axis that is not actuated stays where it is."""
    arm = simulator.arm
    configurations = np.random.default_rng(seed).uniform(
        arm.lower, arm.upper, (count, arm.n_joints)
    )
    configurations[:, simulator.n_actions :] = last
    return configurations


def paths(simulator, starts, actions):
    """Configurations that the simulator visits, for a goal that it never reaches."""
    outcome = simulator.rollout_actions(
        actions, starts, np.tile(FAR, (len(starts), 1)), record=True
    )
    assert not outcome.collision.any()
    assert (outcome.steps == simulator.task.horizon).all()
    return outcome.paths


def straight(simulator, starts, ends, steps):
    """Straight motions: the point between is where they end."""
    return two_segments(simulator, starts, ends, ends, steps, steps)


def assert_within_rates(actions):
    """Nothing is left to the simulator's clipping."""
    assert (np.abs(actions) <= 1 + 1e-12).all()


def test_only_three_axes_are_actuated(free):
    assert (free.n_actions, free.arm.n_joints) == (3, 4)
    np.testing.assert_allclose(free.step_limit, LIMITS)


class TestStepsBetween:
    def test_slowest_axis_decides(self, free):
        zero = np.zeros(4)
        for move, steps in (
            ([0.6, 0, 0, 0], 10),
            ([0, -0.3, 0, 0], 15),
            ([0.6, 0.3, -0.9, 0], 15),
            ([0.03, 0, 0, 0], 0.5),
            ([0, 0, 0, 2], 0),
        ):
            assert steps_between(free, zero, np.array(move)) == pytest.approx(steps)


class TestStraight:
    def test_arrives_on_a_straight_line(self, free):
        starts, ends = drawn(free, 3, 40), drawn(free, 4, 40)
        needed = np.ceil(steps_between(free, starts, ends)).astype(int)
        kept = needed <= 64
        starts, ends, needed = starts[kept], ends[kept], needed[kept]
        actions = straight(free, starts, ends, needed)
        assert actions.shape == (len(starts), 64, 3)
        assert_within_rates(actions)
        for path, start, end, steps in zip(
            paths(free, starts, actions), starts, ends, needed, strict=True
        ):
            shares = np.minimum(np.arange(65) / steps, 1)[:, None]
            np.testing.assert_allclose(path, start + shares * (end - start), rtol=0, atol=1e-12)

    def test_fewer_steps_are_too_few(self, free):
        starts, ends = drawn(free, 5, 40), drawn(free, 6, 40)
        needed = np.ceil(steps_between(free, starts, ends)).astype(int)
        actions = straight(free, starts, ends, needed - 1)
        assert (np.abs(actions).max(axis=(1, 2)) > 1).all()

    def test_rests_at_the_end(self, free):
        starts = drawn(free, 9, 2)
        ends = starts + np.array([0.1, 0.02, -0.1, 0])
        actions = straight(free, starts, ends, np.array([3, 9]))
        np.testing.assert_array_equal(actions[0, 3:], 0)
        np.testing.assert_array_equal(actions[1, 9:], 0)
        assert (actions[1, :9] != 0).all()


class TestTwoSegments:
    def test_passes_the_point_between_and_arrives(self, free):
        starts, vias, ends = (drawn(free, seed, 60) for seed in (10, 11, 12))
        turn = np.ceil(steps_between(free, starts, vias)).astype(int)
        steps = turn + np.ceil(steps_between(free, vias, ends)).astype(int)
        kept = steps <= 64
        assert kept.sum() > 5
        starts, vias, ends, turn, steps = (part[kept] for part in (starts, vias, ends, turn, steps))
        actions = two_segments(free, starts, vias, ends, turn, steps)
        assert_within_rates(actions)
        rows = np.arange(len(starts))
        visited = paths(free, starts, actions)
        np.testing.assert_allclose(visited[rows, turn], vias, rtol=0, atol=1e-12)
        np.testing.assert_allclose(visited[rows, steps], ends, rtol=0, atol=1e-12)
        np.testing.assert_allclose(visited[:, -1], ends, rtol=0, atol=1e-12)

    def test_each_half_is_straight(self, free):
        starts, vias, ends = (0.3 * drawn(free, seed, 1, 0) for seed in (13, 14, 15))
        actions = two_segments(free, starts, vias, ends, np.array([20]), np.array([50]))
        assert np.ptp(actions[0, :20], axis=0).max() < 1e-12
        assert np.ptp(actions[0, 20:50], axis=0).max() < 1e-12
        np.testing.assert_array_equal(actions[0, 50:], 0)


def polyline(free, seed, corners):
    """A path of short segments."""
    path = 0.3 * drawn(free, seed, corners, 0)
    path[:, 1] *= 0.5
    return path


def deviation(path, configuration):
    """Largest difference of an axis from the nearest point of a path of segments."""
    fine = [a + np.linspace(0, 1, 400)[:, None] * (b - a) for a, b in itertools.pairwise(path)]
    return np.abs(np.concatenate(fine) - configuration).max(axis=1).min()


class TestAlongPath:
    @pytest.mark.parametrize("seed", range(6))
    def test_through_corners_visits_them_all(self, free, seed):
        path = polyline(free, 20 + seed, 4)
        actions = along_path(free, path, through_corners=True)
        assert_within_rates(actions)
        visited = paths(free, path[:1], actions[None])[0]
        legs = np.ceil(steps_between(free, path[:-1], path[1:])).astype(int)
        at = np.concatenate([[0], np.cumsum(legs)])
        np.testing.assert_allclose(visited[at], path, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(actions[at[-1] :], 0)
        assert max(deviation(path, q) for q in visited) < 2e-3

    @pytest.mark.parametrize("seed", range(6))
    def test_cutting_corners_takes_no_more_steps(self, free, seed):
        path = polyline(free, 30 + seed, 5)
        actions = along_path(free, path, through_corners=False)
        assert_within_rates(actions)
        visited = paths(free, path[:1], actions[None])[0]
        np.testing.assert_allclose(visited[-1], path[-1], rtol=0, atol=1e-9)
        n_steps = int(np.ceil(steps_between(free, path[:-1], path[1:]).sum()))
        np.testing.assert_array_equal(actions[n_steps:], 0)
        slow = along_path(free, path, through_corners=True)
        assert n_steps <= np.flatnonzero(slow.any(axis=1))[-1] + 1
        # Every step ends on the path, whatever it cuts between.
        assert max(deviation(path, q) for q in visited) < 2e-3
        # All but the steps at the three corners, and the last one, are at full speed.
        at_full_speed = np.abs(actions).max(axis=1) > 1 - 1e-9
        assert n_steps - 4 <= at_full_speed.sum() <= n_steps

    @pytest.mark.parametrize("through_corners", [False, True])
    def test_too_long_for_the_horizon(self, free, through_corners):
        # The slide moves by 0.02 m a step: 19.6, 39.5 and 3.7 steps, that is 62.8 or 20 + 40 + 4.
        path = np.zeros((4, 4))
        path[:, 1] = [0, 0.392, -0.398, -0.324]
        actions = along_path(free, path, through_corners=through_corners)
        moving = (actions != 0).any(axis=1)
        assert moving.sum() == (64 if through_corners else 63)
        path[-1, 1] += 0.03
        assert along_path(free, path, through_corners=through_corners) is None

    @pytest.mark.parametrize("through_corners", [False, True])
    def test_paths_without_length(self, free, through_corners):
        point = drawn(free, 41, 1)
        for path in (point, np.repeat(point, 3, axis=0)):
            actions = along_path(free, path, through_corners=through_corners)
            np.testing.assert_array_equal(actions, np.zeros((64, 3)))

    @pytest.mark.parametrize("through_corners", [False, True])
    def test_repeated_corners(self, free, through_corners):
        path = polyline(free, 42, 3)
        doubled = np.repeat(path, 2, axis=0)
        np.testing.assert_allclose(
            along_path(free, doubled, through_corners=through_corners),
            along_path(free, path, through_corners=through_corners),
            rtol=0,
            atol=1e-12,
        )


def test_motions_of_a_shipped_arm_reach_the_tool_position(simulator):
    rng = np.random.default_rng(50)
    starts, _ = simulator.sample(rng, 40)
    ends, _ = simulator.sample(rng, 40)
    steps = np.ceil(steps_between(simulator, starts, ends)).astype(int)
    goals = np.array([simulator.arm.tool_position(q) for q in ends])
    outcome = simulator.rollout_actions(straight(simulator, starts, ends, steps), starts, goals)
    assert (outcome.success | outcome.collision).all()
    assert outcome.success.sum() > 10
    assert (outcome.steps <= steps).all()
