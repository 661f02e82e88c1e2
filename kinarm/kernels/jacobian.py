"""The spatial Jacobian: how a point moves and its link turns, for a number or lanes."""

from kinarm.chain import Chain
from kinarm.kernels.compiling import Array, Vector, inlined
from kinarm.kernels.kinematics import point_jacobian
from kinarm.kernels.planes import rotated


@inlined
def spatial_jacobian(chain: Chain, poses: Array, point: Vector, jacobian: Array) -> None:
    """Fill in the velocity of a point and the angular velocity of its link, in the world frame.

    Per unit speed of each of the first joints, beyond which the point lies; the Jacobian has the
    shape (6, n), or (3, n) without angular velocities.
    """
    prismatic, axis = chain[0], chain[3]
    point_jacobian(prismatic, axis, poses, point, jacobian)
    for k in range(jacobian.shape[1] if jacobian.shape[0] == 6 else 0):
        x, y, z = rotated(poses, k + 1, axis[k, 0], axis[k, 1], axis[k, 2])
        turns = 0.0 if prismatic[k] else 1.0
        jacobian[3, k], jacobian[4, k], jacobian[5, k] = turns * x, turns * y, turns * z
