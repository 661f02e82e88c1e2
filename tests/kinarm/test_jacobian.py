"""The compiled Jacobian against Pinocchio's, and against finite differences."""

import numpy as np
import pinocchio as pin
import pytest
from numba import njit

from kinarm import kernels

STEP = 1e-6


@njit
def jacobians_of(chain, configurations, frame, point, poses, jacobians):
    for i in range(len(configurations)):
        kernels.forward_kinematics(
            chain.prismatic, chain.translation, chain.rotation, chain.axis, configurations, i, poses
        )
        world = kernels.to_world(poses, frame, point[0], point[1], point[2])
        kernels.point_jacobian(chain.prismatic, chain.axis, poses, world, jacobians[i])


def jacobians(arm, configurations, frame, point, n):
    """Jacobians of a point of a frame with respect to the first n axes."""
    filled = np.full((len(configurations), 3, n), np.nan)
    poses = np.empty((arm.n_axes + 1, kernels.POSE))
    jacobians_of(arm.chain, configurations, frame, np.asarray(point), poses, filled)
    return filled


def drawn(arm, seed, count):
    return np.random.default_rng(seed).uniform(arm.lower, arm.upper, (count, arm.n_axes))


class TestToolJacobian:
    def test_equals_pinocchio(self, any_simulator):
        arm = any_simulator.arm
        configurations = drawn(arm, 1, 300)
        compiled = jacobians(arm, configurations, arm.n_axes, arm.chain.tool, arm.n_axes)
        frame = arm.model.getFrameId(arm.tool_frame, pin.FrameType.BODY)
        data = arm.model.createData()
        for q, jacobian in zip(configurations, compiled, strict=True):
            expected = pin.computeFrameJacobian(
                arm.model, data, q, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            )
            np.testing.assert_allclose(jacobian, expected[:3], rtol=0, atol=1e-12)

    def test_equals_finite_differences(self, any_simulator):
        arm = any_simulator.arm
        configurations = drawn(arm, 2, 60)
        compiled = jacobians(arm, configurations, arm.n_axes, arm.chain.tool, arm.n_axes)
        moves = STEP * np.eye(arm.n_axes)
        for q, jacobian in zip(configurations, compiled, strict=True):
            for axis, move in enumerate(moves):
                change = arm.tool_position(q + move) - arm.tool_position(q - move)
                np.testing.assert_allclose(
                    jacobian[:, axis], change / (2 * STEP), rtol=0, atol=1e-8
                )

    def test_first_axes_alone(self, any_simulator):
        arm = any_simulator.arm
        configurations = drawn(arm, 3, 20)
        whole = jacobians(arm, configurations, arm.n_axes, arm.chain.tool, arm.n_axes)
        for n in range(1, arm.n_axes):
            part = jacobians(arm, configurations, arm.n_axes, arm.chain.tool, n)
            np.testing.assert_array_equal(part, whole[:, :, :n])

    def test_by_hand(self, shipped_arms):
        # At zero the flange is at (0.475, 0, 0.705); axis 2 passes (0.075, 0, 0.33) along y.
        arm = shipped_arms["paper_flange"]
        jacobian = jacobians(arm, np.zeros((1, 6)), 6, arm.chain.tool, 3)[0]
        expected = np.array([[0, 0.475, 0], [0.375, 0, -0.4], [-0.075, 0, 0.4]]).T
        np.testing.assert_allclose(jacobian, expected, atol=1e-12)


@pytest.mark.parametrize("frame", [1, 3, 4])
def test_points_of_other_links_by_finite_differences(any_simulator, frame):
    arm = any_simulator.arm
    point = np.array([0.1, -0.2, 0.05])
    configurations = drawn(arm, 4, 30)
    compiled = jacobians(arm, configurations, frame, point, frame)
    data = arm.model.createData()

    def place(q):
        pin.forwardKinematics(arm.model, data, q)
        return data.oMi[frame].act(point)

    for q, jacobian in zip(configurations, compiled, strict=True):
        for axis, move in enumerate(STEP * np.eye(arm.n_axes)[:frame]):
            change = (place(q + move) - place(q - move)) / (2 * STEP)
            np.testing.assert_allclose(jacobian[:, axis], change, rtol=0, atol=1e-8)
