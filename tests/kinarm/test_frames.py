"""Poses and Jacobians of frames, held against Pinocchio and finite differences."""

import numpy as np
import pinocchio as pin
from configurations import random_configurations


def pinocchio_frame(arm, name, kind, q):
    """Pose and Jacobian of a frame, along the world's axes."""
    model, data = arm.model, arm.model.createData()
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    number = model.getFrameId(name, kind)
    jacobian = pin.getFrameJacobian(model, data, number, pin.LOCAL_WORLD_ALIGNED)
    return np.array(data.oMf[number].homogeneous), np.array(jacobian)


def test_all_frames_equal_pinocchio(any_simulator):
    world, arm = any_simulator.world, any_simulator.arm
    q = random_configurations(any_simulator, 1, 40)
    kinds = {frame.name: frame.type for frame in reversed(arm.model.frames)}
    assert set(arm.joint_names) < set(world.frames)
    for name in world.frames:
        poses, jacobians = world.poses(q, name), world.jacobians(q, name)
        for row, each in enumerate(q):
            pose, jacobian = pinocchio_frame(arm, name, kinds[name], each)
            np.testing.assert_allclose(poses[row], pose, rtol=0, atol=1e-12)
            np.testing.assert_allclose(jacobians[row], jacobian, rtol=0, atol=1e-12)


def test_tool_is_the_default(any_simulator):
    world, arm = any_simulator.world, any_simulator.arm
    q = random_configurations(any_simulator, 2, 30)
    np.testing.assert_array_equal(world.poses(q), world.poses(q, arm.tool_frame))
    np.testing.assert_array_equal(world.poses(q)[:, :3, 3], world.screen(q)[0])


def test_jacobian_is_the_derivative_of_the_pose(any_simulator):
    world, n = any_simulator.world, any_simulator.arm.n_joints
    step = 1e-6
    for q in random_configurations(any_simulator, 3, 10):
        jacobian = world.jacobians(q)
        for joint in range(n):
            before, after = (world.poses(q + sign * step * np.eye(n)[joint]) for sign in (-1, 1))
            speed = (after - before) / (2 * step)
            spin = speed[:3, :3] @ world.poses(q)[:3, :3].T
            expected = [*speed[:3, 3], spin[2, 1], spin[0, 2], spin[1, 0]]
            np.testing.assert_allclose(jacobian[:, joint], expected, rtol=0, atol=1e-8)


def test_one_is_as_many(simulator):
    world, q = simulator.world, random_configurations(simulator, 4, 5)
    for ask in (world.poses, world.jacobians, world.in_contact):
        together = ask(q)
        for row, each in enumerate(q):
            np.testing.assert_array_equal(ask(each.tolist()), together[row])
        assert ask(np.empty((0, 6))).shape == (0, *together.shape[1:])
