"""Paths around a wall, and none where there is none; motions of the oracle along them."""

import itertools

import numpy as np
import pytest
from configurations import pair_distances

from kinarm.arm import Arm
from kinarm.policies.oracle import motion_search
from kinarm.policies.oracle.goals import Stage
from kinarm.policies.oracle.inverse import steps_between
from kinarm.policies.oracle.motion_search import MotionSearch, along_path, two_segments
from kinarm.policies.planning.motions import Motions
from kinarm.policies.planning.paths import find_path
from kinarm.problem import PROBLEMS
from kinarm.scene import PAPER_BENCHES, Obstacle, Scene
from kinarm.simulator import Simulator

WALL = Obstacle(name="wall", lower=(0.35, -0.06, 0.0), upper=(0.8, 0.06, 0.9))
START = np.array([-0.9, 0.3, 0.0, 0.0, 0.2, 0.7])
END = np.array([0.9, 0.3, 0.0, 0.0, 0.2, 0.7])


@pytest.fixture(scope="module")
def walled():
    """The default arm with a wall before it, which it has to pass above or behind."""
    scene = Scene(obstacles=(*PAPER_BENCHES, WALL))
    return Simulator(PROBLEMS["both"].replace(scene=scene), threads=1)


@pytest.fixture(scope="module")
def parted(make_joint, make_collision, write_robot):
    """Two links in a plane, and a wall that the first one cannot pass."""
    limit = '<limit lower="-3.1" upper="3.1" velocity="3" effort="0"/>'
    bar = make_collision(
        '<capsule radius="0.03" length="0.5"/>', xyz="0.25 0 0", rpy="0 1.5707963267948966 0"
    )
    joints = [make_joint(xyz="0 0 0.4", limit=limit), make_joint(xyz="0.5 0 0", limit=limit)]
    arm = Arm.load(write_robot(joints, {1: bar}, tool="0.3 0 0"))
    wall = Obstacle(name="wall", lower=(-1, 0.3, 0), upper=(1, 0.4, 1))
    return Simulator(PROBLEMS["left"].replace(arm=arm, scene=Scene(obstacles=(wall,))))


def generator(seed=0):
    return np.random.default_rng(seed)


def between(simulator, path, per_step=16):
    """Configurations along a path, many for each step that it takes."""
    parts = [path[:1]]
    for first, second in itertools.pairwise(path):
        count = 1 + int(per_step * steps_between(simulator, first, second))
        parts.append(first + np.linspace(0, 1, count + 1)[1:, None] * (second - first))
    return np.concatenate(parts)


def length(simulator, path):
    return steps_between(simulator, path[:-1], path[1:]).sum()


def test_the_straight_way_is_blocked(walled):
    ends = np.array([START, END])
    assert not walled.world.contact_model.in_contact(ends).any()
    way = between(walled, ends)
    assert walled.world.contact_model.in_contact(way).mean() > 0.05


@pytest.fixture(scope="module")
def detours(walled):
    return [
        find_path(Motions(walled.world), START, END[None], generator(seed)) for seed in range(12)
    ]


class TestAroundTheWall:
    def test_begins_and_ends_where_it_should(self, walled, detours):
        arm = walled.arm
        for path in detours:
            np.testing.assert_array_equal(path[0], START)
            np.testing.assert_array_equal(path[-1], END)
            assert ((path >= arm.lower) & (path <= arm.upper)).all()
            np.testing.assert_array_equal(path[:, 5], 0.7)
            assert len(path) > 2
            assert length(walled, path) >= steps_between(walled, START, END)

    def test_nothing_touches_on_the_way(self, walled, detours):
        way = np.concatenate([between(walled, path) for path in detours])
        assert not walled.world.contact_model.in_contact(way).any()

    @pytest.mark.parametrize("margin", [0.004, 0.03])
    def test_pairs_keep_a_margin(self, walled, margin):
        path = find_path(Motions(walled.world, margin), START, END[None], generator())
        assert pair_distances(walled.world, between(walled, path)).min() > margin

    def test_motions_along_it_arrive_in_the_simulator(self, walled, detours):
        goal = walled.arm.tool_position(END)[None]
        actions = [along_path(walled, path, through_corners=True) for path in detours]
        starts, goals = np.tile(START, (len(detours), 1)), np.repeat(goal, len(detours), axis=0)
        outcome = walled.rollout_actions(actions, starts, goals)
        assert outcome.success.all()
        ends, steps = END[None], np.array([64])
        blocked = two_segments(walled, START[None], ends, ends, steps, steps)
        assert walled.rollout_actions(blocked, START[None], goal).collision[0]


class TestEnds:
    def test_one_of_several_is_reached(self, walled):
        ends = np.array([END, END + 0.2 * np.eye(6)[0], START + 0.1 * np.eye(6)[0]])
        reached = set()
        for seed in range(4):
            path = find_path(Motions(walled.world), START, ends, generator(seed))
            matches = np.flatnonzero((ends == path[-1]).all(axis=1))
            assert matches.size == 1
            reached.add(int(matches[0]))
        # The last one lies on this side of the wall.
        assert 2 in reached

    def test_free_way_is_nearly_straight(self, walled):
        end = START + np.array([-0.4, 0.1, 0.2, 0.3, -0.1, 0])
        path = find_path(Motions(walled.world), START, end[None], generator())
        np.testing.assert_array_equal(path, [START, end])

    def test_none_behind_a_wall_that_cannot_be_passed(self, parted):
        # From 0 to 3.0 rad the first link would have to cross the wall; the limits end at 3.1 rad
        # on the other side, too.
        start, end = np.array([0.0, 0.1]), np.array([3.0, 0.1])
        assert not parted.world.contact_model.in_contact(np.array([start, end])).any()
        assert find_path(Motions(parted.world), start, end[None], generator()) is None

    def test_reachable_end_beside_one_that_is_not(self, parted):
        start, ends = np.array([0.0, 0.1]), np.array([[3.0, 0.1], [-2.5, 0.4]])
        path = find_path(Motions(parted.world), start, ends, generator())
        np.testing.assert_array_equal(path[-1], ends[1])


class TestWhatIsTried:
    """Motions along detours, of which one trial has none and another none that is short enough."""

    @pytest.fixture
    def search(self, walled):
        goal = walled.arm.tool_position(END)
        return MotionSearch(walled, START[None], Stage(goal[None]))

    def test_without_a_detour_there_is_no_motion(self, search, monkeypatch):
        asked = []
        monkeypatch.setattr(motion_search, "find_path", lambda *given: asked.append(given))
        search.try_detours(np.array([0]))
        assert len(asked) == 1
        assert not search.reached.any()

    def test_detours_that_take_too_long_are_not_played(self, search, monkeypatch):
        monkeypatch.setattr(motion_search, "find_path", lambda *_: np.array([START, END]))
        monkeypatch.setattr(motion_search, "along_path", lambda *_, **__: None)
        search.try_detours(np.array([0]))
        assert not search.reached.any()
        assert np.isinf(search.costs).all()
