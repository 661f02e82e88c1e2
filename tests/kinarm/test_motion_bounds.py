"""Certified bounds of motion, held against Pinocchio's Jacobians and finite motions."""

import numpy as np
import pinocchio as pin
import pytest

from kinarm.arm import Arm
from kinarm.chain import MotionBounds, link_lengths, point_speed

NAMES = ("paper", "sliding", "mesh", "gantry", "crane")

ROUNDING = 1e-12


def slide(make_joint, lower, upper, **settings):
    limit = f'<limit lower="{lower}" upper="{upper}" velocity="1" effort="0"/>'
    return make_joint("prismatic", limit=limit, **settings)


@pytest.fixture(scope="module")
def arms(simulators, make_joint, write_robot):
    """The shared arms, and two in which slides come first, last and next to each other."""
    gantry = [
        slide(make_joint, -0.4, 0.5, xyz="0 0 0.3", rpy="0.2 0 0", axis="1 0 0"),
        slide(make_joint, -0.3, 0.2, xyz="0.05 0 0", rpy="0 0.5 0.1", axis="0 0.6 0.8"),
        make_joint(xyz="0 0.1 0.2", axis="0 1 0"),
        make_joint(xyz="0.3 0 0", rpy="0.4 0 0", axis="0.6 0 0.8"),
    ]
    crane = [
        make_joint(xyz="0 0 0.2"),
        make_joint(xyz="0.05 0 0.1", axis="0 1 0"),
        slide(make_joint, 0.1, 0.6, xyz="0 0.02 0.1", rpy="0 0.3 0", axis="1 0 0"),
    ]
    made = {
        "gantry": Arm.load(write_robot(gantry)),
        "crane": Arm.load(write_robot(crane, tool="0 0 0.2")),
    }
    return {name: simulator.arm for name, simulator in simulators.items()} | made


@pytest.fixture(params=NAMES)
def arm(request, arms):
    return arms[request.param]


@pytest.fixture
def planar_chain(make_joint, write_robot):
    """Two parallel axes, 0.5 m apart, and a tool 0.3 m from the second."""
    joints = [make_joint(xyz="0 0 0.7"), make_joint(xyz="0.5 0 0.1")]
    return Arm.load(write_robot(joints, tool="0.3 0 -0.2")).chain


def bounds_of(arm):
    return MotionBounds.of(arm.chain, arm.n_actuated)


def drawn(arm, rng, count):
    return rng.uniform(arm.lower, arm.upper, (count, arm.n_joints))


def frame_poses(arm, q):
    """World poses of the joint frames."""
    data = arm.model.createData()
    pin.forwardKinematics(arm.model, data, q)
    return [pin.SE3(data.oMi[k]) for k in range(1, arm.model.njoints)]


def velocities(arm, q, link, point):
    """How fast a point of a link moves per unit speed of each axis, shape (3, n_joints)."""
    data = arm.model.createData()
    pin.computeJointJacobians(arm.model, data, q)
    frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    jacobian = pin.getJointJacobian(arm.model, data, link, frame)
    arm_of_point = data.oMi[link].rotation @ point
    return jacobian[:3] + np.cross(jacobian[3:].T, arm_of_point).T


def moves(arm, rng, count):
    """Pairs of configurations within the limits, from close to far, along one axis or all."""
    before = drawn(arm, rng, count)
    n, size = arm.n_actuated, 10.0 ** rng.uniform(-2, 0.5, (count, 1))
    single = rng.integers(0, n, count)[:, None] == np.arange(n)
    moved = np.where(np.arange(count)[:, None] % 3 == 0, single, True)
    after = before.copy()
    after[:, :n] += size * moved * rng.uniform(-1, 1, (count, n))
    return before, np.clip(after, arm.lower, arm.upper)


def remainder_shares(arm, before, after):
    """Deviation of the tool from its linear motion, and the bound of that, per pair."""
    curvature, n = bounds_of(arm).curvature, arm.n_actuated
    deviations, allowed = [], []
    for q, moved in zip(before, after, strict=True):
        e = moved - q
        linear = arm.tool_position(q) + velocities(arm, q, arm.n_joints, arm.chain.tool) @ e
        deviations.append(np.linalg.norm(arm.tool_position(moved) - linear))
        turn = np.abs(e[:n])
        allowed.append(turn @ curvature @ turn / 2)
    return np.array(deviations), np.array(allowed)


class TestPointSpeed:
    def test_bounds_the_columns_of_the_jacobian(self, arm):
        chain = arm.chain
        speeds = [
            point_speed(chain, i, arm.n_joints, chain.tool[None]) for i in range(arm.n_joints)
        ]
        frame = arm.model.getFrameId(arm.tool_frame, pin.FrameType.BODY)
        data, columns = arm.model.createData(), []
        for q in drawn(arm, np.random.default_rng(0), 1500):
            jacobian = pin.computeFrameJacobian(
                arm.model, data, q, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            )
            columns.append(np.linalg.norm(jacobian[:3], axis=0))
        fastest = np.max(columns, axis=0)
        assert (fastest <= np.array(speeds) + ROUNDING).all()
        assert (fastest[: arm.n_actuated] > 0.5 * np.array(speeds)[: arm.n_actuated]).all()

    def test_bounds_any_point_between_given_ones_of_any_link(self, arm):
        rng = np.random.default_rng(1)
        for link in range(1, arm.n_joints + 1):
            corners = rng.normal(size=(4, 3)) * 0.3
            between = rng.dirichlet(np.full(4, 0.3), 40) @ corners
            bound = [point_speed(arm.chain, axis, link, corners) for axis in range(link)]
            for q, point in zip(drawn(arm, rng, 40), between, strict=True):
                speed = np.linalg.norm(velocities(arm, q, link, point), axis=0)
                assert (speed[:link] <= np.array(bound) + ROUNDING).all()
                np.testing.assert_array_equal(speed[link:], 0)

    def test_hand_computed(self, planar_chain):
        # The height of a point does not count, nor does that of the second axis.
        tool = planar_chain.tool[None]
        assert point_speed(planar_chain, 1, 2, tool) == pytest.approx(0.3)
        assert point_speed(planar_chain, 0, 2, tool) == pytest.approx(0.5 + np.hypot(0.3, 0.2))
        assert point_speed(planar_chain, 0, 1, np.array([[0.3, 0.4, 9.0]])) == pytest.approx(0.5)

    def test_the_extent_of_a_slide_counts(self, arms):
        # Joint 3 starts (0, 0.02, 0.1) from joint 2, whose axis is y, and slides by up to 0.6 m.
        speed = point_speed(arms["crane"].chain, 1, 3, np.zeros((1, 3)))
        assert speed == pytest.approx(0.1 + 0.6)


class TestCurvature:
    def test_bounds_the_remainder_of_the_linear_motion(self, arm):
        deviations, allowed = remainder_shares(arm, *moves(arm, np.random.default_rng(2), 900))
        assert (deviations <= allowed + ROUNDING).all()
        assert (deviations > 0.3 * allowed)[allowed > 1e-6].any()

    def test_is_symmetric_and_zero_where_slides_come_first(self, arm):
        curvature = bounds_of(arm).curvature
        np.testing.assert_array_equal(curvature, curvature.T)
        prismatic = arm.chain.prismatic[: arm.n_actuated]
        for i in np.flatnonzero(prismatic):
            np.testing.assert_array_equal(curvature[i, i:], 0)

    def test_hand_computed(self, planar_chain):
        inner, outer = 0.3, 0.5 + np.hypot(0.3, 0.2)
        expected = [[outer, inner], [inner, inner]]
        np.testing.assert_allclose(MotionBounds.of(planar_chain, 2).curvature, expected)


class TestJointOrigins:
    def test_swing_bounds_how_far_they_move(self, arm):
        bounds, n = bounds_of(arm), arm.n_actuated
        before, after = moves(arm, np.random.default_rng(4), 900)
        shares = np.zeros(n)
        for q, moved in zip(before, after, strict=True):
            old, new = frame_poses(arm, q), frame_poses(arm, moved)
            motion = np.array(
                [np.linalg.norm(new[k].translation - old[k].translation) for k in range(n)]
            )
            allowed = np.abs(moved - q)[:n] @ bounds.swing
            assert (motion <= allowed + ROUNDING).all()
            shares = np.fmax(shares, motion / np.fmax(allowed, 1e-9))
        assert (shares[bounds.swing.any(axis=0)] > 0.3).all()

    def test_length_bounds_the_distance_to_the_tool(self, arm):
        length, n = bounds_of(arm).length, arm.n_actuated
        farthest = np.zeros(n)
        for q in drawn(arm, np.random.default_rng(5), 1500):
            origins = np.array([pose.translation for pose in frame_poses(arm, q)[:n]])
            distance = np.linalg.norm(origins - arm.tool_position(q), axis=1)
            assert (distance <= length + ROUNDING).all()
            farthest = np.fmax(farthest, distance)
        assert (farthest > 0.6 * length).all()

    def test_links_on_either_side_of_a_turning_joint_count_as_one(self, make_joint, write_robot):
        # The second axis lies along the upper arm: no turn brings the third one farther out.
        joints = [
            make_joint(axis="0 1 0"),
            make_joint(xyz="0 0 0.3", rpy="0.7 0 0", axis="0 0.6442176872 0.7648421873"),
            make_joint(xyz="0.05 0 0", axis="0 1 0"),
        ]
        arm = Arm.load(write_robot(joints, tool="0 0 0.2"))
        expected = [np.hypot(0.3, 0.05) + 0.2, 0.25, 0.2]
        np.testing.assert_allclose(bounds_of(arm).length, expected, atol=1e-9)

    def test_slides_count_with_their_longer_side(self, arms):
        lengths = link_lengths(arms["gantry"].chain)
        expected = [0.3 + 0.5, 0.05 + 0.3, np.hypot(0.1, 0.2), 0.3]
        np.testing.assert_allclose(lengths, expected, atol=1e-15)


@pytest.mark.parametrize("n", [1, 3, 6])
def test_first_axes_alone(shipped_arms, n):
    whole, part = (MotionBounds.of(shipped_arms["paper"].chain, count) for count in (6, n))
    np.testing.assert_array_equal(part.curvature, whole.curvature[:n, :n])
    np.testing.assert_array_equal(part.swing, whole.swing[:n, :n])
    np.testing.assert_array_equal(part.length, whole.length[:n])
