"""Kernels that place frames of an arm."""

import numpy as np

from kinarm.chain import Chain
from kinarm.kernels.compiling import Array, kernel
from kinarm.kernels.jacobian import spatial_jacobian
from kinarm.kernels.kinematics import POSE, forward_kinematics, to_world
from kinarm.kernels.planes import rotated


@kernel
def place_frame(
    first: int,
    last: int,
    chain: Chain,
    joint: int,
    placement: Array,
    configurations: Array,
    transforms: Array,
) -> None:
    """Write where a frame is at some rows of the configurations.

    The frame is fixed to a joint, 0 being the world, at a ``placement`` of shape (4, 4), as are
    the ``transforms``.
    """
    poses = np.zeros((configurations.shape[1] + 1, POSE))
    for row in range(first, last):
        forward_kinematics(*chain[:4], configurations, row, poses)
        for k in range(3):
            x, y, z = placement[0, k], placement[1, k], placement[2, k]
            x, y, z = rotated(poses, joint, x, y, z)
            transforms[row, 0, k], transforms[row, 1, k], transforms[row, 2, k] = x, y, z
            transforms[row, 3, k] = 0.0
        x, y, z = to_world(poses, joint, placement[0, 3], placement[1, 3], placement[2, 3])
        transforms[row, 0, 3], transforms[row, 1, 3], transforms[row, 2, 3] = x, y, z
        transforms[row, 3, 3] = 1.0


@kernel
def move_frame(
    first: int,
    last: int,
    chain: Chain,
    joint: int,
    placement: Array,
    configurations: Array,
    jacobians: Array,
) -> None:
    """Write how a frame moves at some rows of the configurations, shape (n, 6, n_joints).

    What the joints beyond the frame do is left as it is.
    """
    poses, jacobian = np.zeros((configurations.shape[1] + 1, POSE)), np.empty((6, joint))
    for row in range(first, last):
        forward_kinematics(*chain[:4], configurations, row, poses)
        point = to_world(poses, joint, placement[0, 3], placement[1, 3], placement[2, 3])
        spatial_jacobian(chain, poses, point, jacobian)
        for i in range(6):
            for k in range(joint):
                jacobians[row, i, k] = jacobian[i, k]
