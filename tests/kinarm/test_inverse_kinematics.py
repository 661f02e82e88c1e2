"""Inverse kinematics: what is found is a solution, and what there is is found."""

import numpy as np
import pinocchio as pin
import pytest
from configurations import random_configurations
from scipy.optimize import minimize, root
from scipy.spatial.transform import Rotation

from kinarm.arm import Arm
from kinarm.errors import InvalidInputError
from kinarm.problem import ReachProblem
from kinarm.world import World

D1, A2, A3, D4, D5, D6 = 0.089159, -0.425, -0.39225, 0.10915, 0.09465, 0.0823
"""A UR5's lengths after Denavit and Hartenberg [m]."""

TURN = 2 * np.pi


@pytest.fixture(scope="module")
def ur5(make_joint, write_robot):
    """A UR5 without shapes, whose joints make two turns each."""
    limit = f'<limit lower="{-TURN}" upper="{TURN}" velocity="3" effort="0"/>'
    bent = "1.5707963267948966 0 0"
    places = [
        ("0 0 0", "0 0 0"),
        (f"0 0 {D1}", bent),
        (f"{A2} 0 0", "0 0 0"),
        (f"{A3} 0 0", "0 0 0"),
        (f"0 0 {D4}", bent),
        (f"0 0 {D5}", f"-{bent}"),
    ]
    joints = [make_joint(xyz=xyz, rpy=rpy, limit=limit) for xyz, rpy in places]
    return world_of(Arm.load(write_robot(joints, tool=f"0 0 {D6}")))


def world_of(arm, **settings):
    return World(ReachProblem.load("both").replace(arm=arm), **{"threads": 1, **settings})


@pytest.fixture(scope="module")
def elbow(make_joint, write_robot):
    """A column that turns, with two links of 0.5 m and 0.3 m."""
    limit = '<limit lower="-3.141592653589793" upper="3.141592653589793" velocity="5" effort="0"/>'
    joints = [
        make_joint(xyz="0 0 0.4", limit=limit),
        make_joint(xyz="0 0 0", axis="0 1 0", limit=limit),
        make_joint(xyz="0.5 0 0", axis="0 1 0", limit=limit),
    ]
    return world_of(Arm.load(write_robot(joints, tool="0.3 0 0")))


def link(angle, distance, length, twist):
    """Denavit and Hartenberg's transform."""
    c, s, ct, st = np.cos(angle), np.sin(angle), np.cos(twist), np.sin(twist)
    return np.array(
        [
            [c, -s * ct, s * st, length * c],
            [s, c * ct, -c * st, length * s],
            [0, st, ct, distance],
            [0, 0, 0, 1],
        ]
    )


def analytic_solutions(pose):
    """All solutions of a UR5 in closed form, modulo whole turns (Hawkins 2013)."""
    found = []
    wrist = pose @ [0, 0, -D6, 1]
    lead = np.arctan2(wrist[1], wrist[0]) + np.pi / 2
    swing = np.arccos(D4 / np.hypot(wrist[0], wrist[1]))
    for q1 in (lead + swing, lead - swing):
        sine, cosine = np.sin(q1), np.cos(q1)
        bend = (pose[0, 3] * sine - pose[1, 3] * cosine - D4) / D6
        if abs(bend) > 1:
            continue
        for q5 in (np.arccos(bend), -np.arccos(bend)):
            back = pose[:3, :3].T
            q6 = np.arctan2(
                (-back[1, 0] * sine + back[1, 1] * cosine) / np.sin(q5),
                (back[0, 0] * sine - back[0, 1] * cosine) / np.sin(q5),
            )
            last = link(q5, D5, 0, -np.pi / 2) @ link(q6, D6, 0, 0)
            elbow = np.linalg.inv(link(q1, D1, 0, np.pi / 2)) @ pose @ np.linalg.inv(last)
            x, y, _ = (elbow @ [0, -D4, 0, 1])[:3]
            fold = (x * x + y * y - A2 * A2 - A3 * A3) / (2 * A2 * A3)
            if abs(fold) > 1:
                continue
            for q3 in (np.arccos(fold), -np.arccos(fold)):
                q2 = -np.arctan2(y, -x) + np.arcsin(A3 * np.sin(q3) / np.hypot(x, y))
                upper = link(q2, 0, A2, 0) @ link(q3, 0, A3, 0)
                rest = np.linalg.inv(upper) @ elbow
                found.append([q1, q2, q3, np.arctan2(rest[1, 0], rest[0, 0]), q5, q6])
    return np.array(found).reshape(-1, 6)


def is_among(q, configurations, tolerance=1e-6):
    """Whether a configuration is among others, modulo whole turns."""
    apart = (configurations - q + np.pi) % TURN - np.pi
    return bool((np.abs(apart).max(axis=1, initial=0) < tolerance).any())


def assert_same(found, expected):
    assert len(found) == len(expected)
    assert all(is_among(q, found) for q in expected)


def restarted_solutions(arm, pose, count, rng):
    """Distinct solutions within the limits by random restarts of SciPy on Pinocchio's model."""
    data, number = arm.model.createData(), arm.model.getFrameId(arm.tool_frame, pin.FrameType.BODY)
    wanted = pin.SE3(pose).inverse()

    def error(q):
        pin.framesForwardKinematics(arm.model, data, q)
        return pin.log6(wanted * data.oMf[number]).vector

    found = np.empty((0, arm.n_joints))
    for start in rng.uniform(arm.lower, arm.upper, (count, arm.n_joints)):
        result = root(error, start)
        q = (result.x + np.pi) % TURN - np.pi
        for joint in range(arm.n_joints):
            if q[joint] < arm.lower[joint]:
                q[joint] += TURN
        within = (q >= arm.lower).all() and (q <= arm.upper).all()
        if np.abs(error(q)).max() < 1e-9 and within and not is_among(q, found, 1e-4):
            found = np.append(found, [q], axis=0)
    return found


class TestToolPoses:
    def test_equal_pinocchio(self, any_simulator):
        world, arm = any_simulator.world, any_simulator.arm
        q, data = random_configurations(any_simulator, 1, 40), arm.model.createData()
        number = arm.model.getFrameId(arm.tool_frame, pin.FrameType.BODY)
        poses = world.poses(q)
        for pose, each in zip(poses, q, strict=True):
            pin.framesForwardKinematics(arm.model, data, each)
            np.testing.assert_allclose(pose, data.oMf[number].homogeneous, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(poses[:, :3, 3], world.screen(q)[0])

    def test_one_is_as_many(self, simulator):
        world, q = simulator.world, random_configurations(simulator, 4, 5)
        for ask in (world.poses, world.in_contact):
            together = ask(q)
            for row, each in enumerate(q):
                np.testing.assert_array_equal(ask(each.tolist()), together[row])
            assert ask(np.empty((0, 6))).shape == (0, *together.shape[1:])


class TestPoses:
    def test_are_met_within_the_limits_and_the_known_one_is_among_them(self, any_simulator):
        world, arm = any_simulator.world, any_simulator.arm
        known = random_configurations(any_simulator, 1, 60)
        poses = world.poses(known)
        found = world.inverse_kinematics(poses)
        assert found.isolated
        np.testing.assert_allclose(
            world.poses(found.configurations), poses[found.owner], rtol=0, atol=1e-9
        )
        assert (found.configurations >= arm.lower).all()
        assert (found.configurations <= arm.upper).all()
        missed = [row for row, q in enumerate(known) if not is_among(q, found.of(row), 1e-4)]
        assert not missed

    def test_of_a_ur5_are_those_of_the_closed_form(self, ur5):
        q = np.random.default_rng(2).uniform(-np.pi, np.pi, (150, 6))
        poses = ur5.poses(q)
        found = ur5.inverse_kinematics(poses)
        for row, pose in enumerate(poses):
            expected = analytic_solutions(pose)
            assert is_among(q[row], expected)
            assert_same(found.of(row), expected)

    def test_of_the_paper_s_arm_are_those_of_random_restarts(self, simulator):
        rng = np.random.default_rng(3)
        poses = simulator.world.poses(random_configurations(simulator, 3, 6))
        found = simulator.world.inverse_kinematics(poses)
        for row, pose in enumerate(poses):
            assert_same(found.of(row), restarted_solutions(simulator.arm, pose, 300, rng))

    def test_of_any_six_axes_are_at_most_sixteen(self, make_joint, write_robot):
        rng, limit = np.random.default_rng(4), f'lower="{-np.pi}" upper="{np.pi}"'
        joints = [
            make_joint(
                xyz=" ".join(map(str, rng.uniform(-0.3, 0.3, 3))),
                rpy=" ".join(map(str, rng.uniform(-3, 3, 3))),
                limit=f'<limit {limit} velocity="3" effort="0"/>',
            )
            for _ in range(6)
        ]
        world = world_of(Arm.load(write_robot(joints)))
        q = rng.uniform(-np.pi, np.pi, (40, 6))
        found = world.inverse_kinematics(world.poses(q))
        counts = np.bincount(found.owner)
        assert (counts % 2 == 0).all()  # complex roots come in pairs
        assert 2 <= counts.min() < counts.max() <= 16
        assert all(is_among(each, found.of(row)) for row, each in enumerate(q))

    def test_none_out_of_reach(self, simulator):
        pose = simulator.world.poses(np.zeros(6))
        pose[0, 3] = 1.2
        assert simulator.world.inverse_kinematics(pose).of(0).shape == (0, 6)


class TestDirections:
    def test_are_those_of_the_poses_that_point_there(self, ur5):
        """The last joint turns the tool about its axis, so that it does not matter."""
        poses = ur5.poses(np.random.default_rng(5).uniform(-np.pi, np.pi, (60, 6)))
        found = ur5.inverse_kinematics(poses[:, :3, 3], poses[:, :3, 2])
        assert found.isolated
        for row, pose in enumerate(poses):
            expected = analytic_solutions(pose)
            expected[:, 5] = 0
            assert_same(found.of(row), expected)

    def test_are_of_the_axis_away_from_the_arm(self, simulator):
        world = simulator.world
        target = world.poses([0.3, 0.2, 0.1, 0.5, 0.4, 0.0])
        found = world.inverse_kinematics(target[:3, 3], target[:3, 0])
        assert is_among([0.3, 0.2, 0.1, 0.5, 0.4, 0.0], found.of(0))


class TestPositions:
    def test_of_three_joints_are_four(self, elbow):
        rng = np.random.default_rng(6)
        for _ in range(30):
            x, y, z = rng.uniform(0.25, 0.4) * np.array([1, rng.uniform(-1, 1), 1]) + [0, 0, 0.3]
            radius, height = np.hypot(x, y), z - 0.4
            bend = np.arccos((radius**2 + height**2 - 0.34) / 0.3)
            lean, lead = np.arctan2(-height, radius), np.arctan2(y, x)
            slack = np.arctan2(0.3 * np.sin(bend), 0.5 + 0.3 * np.cos(bend))
            ahead = [[lead, lean - slack, bend], [lead, lean + slack, -bend]]
            behind = [[lead + np.pi, np.pi - q2, -q3] for _, q2, q3 in ahead]
            found = elbow.inverse_kinematics([x, y, z])
            assert found.isolated
            assert_same(found.of(0), np.array(ahead + behind))

    def test_of_more_joints_are_spread_and_apart(self, any_simulator):
        world, arm = any_simulator.world, any_simulator.arm
        known = random_configurations(any_simulator, 7, 12)
        known[:, arm.n_actuated :] = arm.home[arm.n_actuated :]
        positions = world.poses(known)[:, :3, 3]
        found = world.inverse_kinematics(positions)
        assert not found.isolated
        reached = world.poses(found.configurations)[:, :3, 3]
        np.testing.assert_allclose(reached, positions[found.owner], rtol=0, atol=1e-9)
        assert (found.configurations >= arm.lower).all()
        assert (found.configurations <= arm.upper).all()
        for row in range(len(known)):
            group = found.of(row)
            apart = np.abs(group[:, None] - group).max(axis=2)
            assert (apart[np.triu_indices(len(group), 1)] > 0.2 - 1e-12).all()
        assert len(found) > 8 * len(known)

    def test_how_many_are_looked_for(self, simulator):
        ask, position = simulator.world.inverse_kinematics, [0.1, -0.5, 0.4]
        assert len(ask(position, most=5)) == 5
        assert len(ask(position, most=500)) > 5

    def test_joints_that_are_not_moved_rest(self, simulator):
        world, near = simulator.world, [0.1, 0.2, 0.1, 0.3, 0.2, -4.0]
        found = world.inverse_kinematics([0.1, 0.5, 0.4], near=near).configurations
        np.testing.assert_array_equal(found[:, 5], -4.0)
        found = world.inverse_kinematics([0.1, 0.5, 0.4], near=near, joints=3)
        assert found.isolated
        np.testing.assert_array_equal(found.configurations[:, 3:], [near[3:]] * len(found))
        assert len(found) > 0


class TestChoices:
    @pytest.mark.parametrize(
        "q", [[0.3, -1.2, 1.4, -1, -1.5, 0.4], [5.0, -4.0, 3.5, -5.5, 6.0, -6.1]]
    )
    def test_nearest_first_which_says_which_turn(self, ur5, q):
        found = ur5.inverse_kinematics(ur5.poses(q), near=q).configurations
        np.testing.assert_allclose(found[0], q, atol=1e-8)
        assert (np.diff(np.abs(found - q).max(axis=1)) >= 0).all()

    def test_turns_are_told_apart(self, ur5):
        pose = ur5.poses([0.3, -1.2, 1.4, -1, -1.5, 0.4])
        once, all_turns = ur5.inverse_kinematics(pose), ur5.inverse_kinematics(pose, turns=True)
        assert len(all_turns) == 2**6 * len(once)
        assert len(np.unique(all_turns.configurations.round(6), axis=0)) == len(all_turns)
        assert all(is_among(q, once.configurations) for q in all_turns.configurations)
        assert (np.abs(all_turns.configurations) <= TURN).all()
        np.testing.assert_allclose(
            ur5.poses(all_turns.configurations), pose[None].repeat(len(all_turns), 0), atol=1e-9
        )

    def test_free_ones_alone(self, any_simulator):
        world = any_simulator.world
        targets = world.poses(random_configurations(any_simulator, 9, 60))
        found, free = (world.inverse_kinematics(targets, free=each) for each in (False, True))
        touching = world.in_contact(found.configurations)
        assert touching.any()
        np.testing.assert_array_equal(free.configurations, found.configurations[~touching])
        np.testing.assert_array_equal(free.owner, found.owner[~touching])


def test_other_targets_and_threads_do_not_matter(simulator):
    positions = simulator.world.poses(random_configurations(simulator, 11, 1100))[:, :3, 3]
    together = simulator.world.inverse_kinematics(positions, most=2)
    spread = World(simulator.problem, threads=3).inverse_kinematics(positions, most=2)
    np.testing.assert_array_equal(together.configurations, spread.configurations)
    for row in (0, 577, 1099):
        alone = simulator.world.inverse_kinematics(positions[row], most=2)
        np.testing.assert_array_equal(alone.configurations, together.of(row))


POINT = [0.1, -0.5, 0.4]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"targets": [0, 0]}, r"targets must have shape \(3\)"),
        ({"targets": [np.eye(4), np.diag([1, 1, -1, 1.0])]}, "target 1 is no pose"),
        ({"targets": np.eye(4), "directions": [0, 0, 1]}, "directions do not apply"),
        ({"targets": POINT, "directions": np.ones((2, 3))}, "2 for 1"),
        ({"targets": POINT, "near": np.full(6, 7.0)}, "near lies outside the limits"),
    ],
)
def test_refusals_are_one_line(simulator, given, message):
    with pytest.raises(InvalidInputError, match=message) as caught:
        simulator.world.inverse_kinematics(**given)
    assert "\n" not in str(caught.value)


@pytest.fixture(scope="module")
def rounded(make_joint, write_robot):
    """An arm of five axes, whose right angles are rounded as in many a URDF."""
    limit = '<limit lower="-3" upper="3" velocity="3" effort="0"/>'
    places = [
        ("0 0 0.1", "0 0 0"),
        ("0 0 0.1", "1.5708 0 0"),
        ("0.2 0 0", "0 0 0"),
        ("0.2 0 0", "0 0 0"),
        ("0.05 0 0", "0 1.5708 0"),
    ]
    joints = [make_joint(xyz=xyz, rpy=rpy, limit=limit) for xyz, rpy in places]
    return world_of(Arm.load(write_robot(joints, tool="0 0 0.1")))


DOWN = [0.0, 0.0, -1.0]
POINTS = [[0.2 * np.cos(angle), 0.2 * np.sin(angle), 0.1] for angle in np.linspace(-2, 2, 16)]


class TestFewAxes:
    """Of five coordinates four joints reach only to the rounding of their axes."""

    def test_directions_are_reached_to_rounding(self, rounded):
        assert len(rounded.inverse_kinematics(POINTS, DOWN, rotation_tolerance=0.0)) == 0
        solutions = rounded.inverse_kinematics(POINTS, DOWN)
        assert set(solutions.owner) == {*range(16)}
        poses = rounded.poses(solutions.configurations)
        apart = np.linalg.norm(poses[:, :3, 3] - np.array(POINTS)[solutions.owner], axis=1)
        turned = np.linalg.norm(np.cross(poses[:, :3, 2], DOWN), axis=1)
        np.testing.assert_allclose(solutions.position_error, apart, atol=1e-15)
        np.testing.assert_allclose(solutions.rotation_error, turned, atol=1e-12)
        assert (apart <= 1e-6).all()
        assert (turned <= 1e-5).all()
        assert turned.max() > 1e-7

    def test_the_nearest_pose_is_given_where_there_is_none(self, rounded):
        pose = np.eye(4)
        pose[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]  # across the arm, which has no joint so
        pose[:3, 3] = [0.2, 0.0, 0.3]
        assert len(rounded.inverse_kinematics(pose)) == 0
        nearest = rounded.inverse_kinematics(pose, best=True)
        assert (nearest.owner == [0]).all()
        reached = rounded.poses(nearest.configurations[0])
        turn = Rotation.from_matrix(pose[:3, :3].T @ reached[:3, :3]).magnitude()
        np.testing.assert_allclose(nearest.rotation_error, turn, atol=1e-7)

        def missed(q):
            placed = rounded.poses(q)
            turn = Rotation.from_matrix(pose[:3, :3].T @ placed[:3, :3]).magnitude()
            off = np.linalg.norm(placed[:3, 3] - pose[:3, 3]) / rounded.arm.reach
            return np.hypot(off, turn)

        drawn = random_configurations(rounded, 3, 2000)
        starts = drawn[np.argsort([missed(q) for q in drawn])[:5]]
        bounds = list(zip(rounded.arm.lower, rounded.arm.upper, strict=True))
        others = [minimize(missed, q, method="Nelder-Mead", bounds=bounds).fun for q in starts]
        assert missed(nearest.configurations[0]) <= min(others) + 1e-3

    def test_the_nearest_of_similar_configurations_is_given(self):
        """Seeds end at configurations that hardly differ, of which the first ones are not best."""
        world = World("both", threads=1)
        best = world.inverse_kinematics([0.7, 0.4, 0.6], [-0.3, 1.5, 2.0], best=True)
        assert len(best) == 1
        assert np.hypot(best.position_error / world.arm.reach, best.rotation_error) < 0.062

    def test_out_of_reach(self, elbow):
        """The arm stretches towards the target."""
        targets = [[2.0, 0.0, 0.4], [0.5, 0.1, 0.5]]
        assert set(elbow.inverse_kinematics(targets).owner) == {1}
        solutions = elbow.inverse_kinematics(targets, best=True)
        assert (solutions.owner == 0).sum() == 1
        assert solutions.position_error[0] == pytest.approx(2.0 - 0.8, abs=1e-6)
        assert solutions.position_error[1:].max() <= 1e-9
