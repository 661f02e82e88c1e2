"""Compiled kinematics against Pinocchio's, and Jacobians against finite differences, too."""

import math

import numpy as np
import pinocchio as pin
import pytest
from configurations import random_configurations
from numba import njit

from kinarm.kernels.kinematics import POSE, forward_kinematics, point_jacobian, to_world

STEP = 1e-6


@njit
def fill(chain, configurations, frame, point, poses, jacobians):
    for i in range(len(configurations)):
        forward_kinematics(chain, configurations, i, poses[i])
        world = to_world(poses[i], frame, point[0], point[1], point[2])
        point_jacobian(chain, poses[i], world, jacobians[i])


def poses_and_jacobians(arm, configurations, frame, point, n):
    """World poses of all frames, and Jacobians of a point of one for the first n joints."""
    count = len(configurations)
    poses, found = np.empty((count, arm.n_joints + 1, POSE)), np.full((count, 3, n), np.nan)
    fill(arm.chain, configurations, frame, np.asarray(point), poses, found)
    return poses, found


def poses_of(arm, configurations):
    return poses_and_jacobians(arm, configurations, arm.n_joints, arm.chain.tool, 1)[0]


def jacobians(arm, configurations, frame, point, n):
    return poses_and_jacobians(arm, configurations, frame, point, n)[1]


class TestForwardKinematics:
    def test_quaternions_describe_the_same_rotations(self, any_simulator):
        arm = any_simulator.arm
        poses = poses_of(arm, random_configurations(any_simulator, 2, 100))
        for w, x, y, z, *rotation in poses[:, 1:, :13].reshape(-1, 13):
            assert math.isclose(w * w + x * x + y * y + z * z, 1, abs_tol=1e-12)
            expected = pin.Quaternion(w, x, y, z).matrix().ravel()
            np.testing.assert_allclose(rotation, expected, rtol=0, atol=1e-12)

    def test_quaternions_have_no_sign_flips_over_the_range_of_any_joint(self, any_simulator):
        arm = any_simulator.arm
        for joint in range(arm.n_joints):
            path = np.tile(random_configurations(any_simulator, 3, 1), (2001, 1))
            path[:, joint] = np.linspace(arm.lower[joint], arm.upper[joint], 2001)
            quaternions = poses_of(arm, path)[:, 1:, :4]
            turned = np.linalg.norm(np.diff(quaternions, axis=0), axis=2).max()
            step = (arm.upper[joint] - arm.lower[joint]) / 2000
            assert turned <= step / 2 + 1e-9
            if not arm.chain.prismatic[joint]:
                assert turned > step / 4


class TestToolJacobian:
    def test_by_hand(self, shipped_arms):
        # At zero the flange is at (0.475, 0, 0.705); joint 2 passes (0.075, 0, 0.33) along y.
        arm = shipped_arms["paper_flange"]
        jacobian = jacobians(arm, np.zeros((1, 6)), 6, arm.chain.tool, 3)[0]
        expected = np.array([[0, 0.475, 0], [0.375, 0, -0.4], [-0.075, 0, 0.4]]).T
        np.testing.assert_allclose(jacobian, expected, atol=1e-12)


@pytest.mark.parametrize("frame", [1, 3, 4])
def test_points_of_other_links_by_finite_differences(any_simulator, frame):
    arm = any_simulator.arm
    point = np.array([0.1, -0.2, 0.05])
    configurations = random_configurations(any_simulator, 4, 30)
    compiled = jacobians(arm, configurations, frame, point, frame)
    data = arm.model.createData()

    def place(q):
        pin.forwardKinematics(arm.model, data, q)
        return data.oMi[frame].act(point)

    for q, jacobian in zip(configurations, compiled, strict=True):
        for joint, move in enumerate(STEP * np.eye(arm.n_joints)[:frame]):
            change = (place(q + move) - place(q - move)) / (2 * STEP)
            np.testing.assert_allclose(jacobian[:, joint], change, rtol=0, atol=1e-8)
