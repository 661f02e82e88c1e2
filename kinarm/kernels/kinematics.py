"""Forward kinematics, frames and Jacobians, for a number or lanes."""

import numpy as np

from kinarm.chain import Chain
from kinarm.kernels.compiling import Array, Vector, helper, inlined, kernel
from kinarm.kernels.elementary import sine_cosine

POSE = 16
"""Entries of a pose: quaternion w x y z, rotation matrix, position.

Bodies of the scene have a size and a rounding instead of the quaternion
(`kinarm.contact_shapes.ContactShapes`).
"""


@helper
def forward_kinematics(chain: Chain, configurations: Array, row: int, poses: Array) -> None:
    """Fill in the world poses of all joint frames at a row of configurations [rad or m].

    Quaternions are composed along the chain, hence continuous in the joint positions.
    """
    prismatic, translation = chain.prismatic, chain.translation
    rotation, axis = chain.rotation, chain.axis
    for i in range(POSE):
        poses[0, i] = 1.0 if i == 0 or i == 4 or i == 8 or i == 12 else 0.0
    for k in range(configurations.shape[1]):
        # The frame's origin in the one before.
        c = k + 1
        tx, ty, tz = translation[k, 0], translation[k, 1], translation[k, 2]
        poses[c, 13], poses[c, 14], poses[c, 15] = to_world(poses, k, tx, ty, tz)
        # The frame's turn about its axis after its fixed rotation.
        fw, fx, fy, fz = rotation[k, 0], rotation[k, 1], rotation[k, 2], rotation[k, 3]
        ax, ay, az = axis[k, 0], axis[k, 1], axis[k, 2]
        sine, cosine = 0.0, 1.0
        if not prismatic[k]:
            sine, cosine = sine_cosine(0.5 * configurations[row, k])
        ux, uy, uz = sine * ax, sine * ay, sine * az
        if fw == 1.0:
            jw, jx, jy, jz = cosine, ux, uy, uz
        else:
            jw = fw * cosine - fx * ux - fy * uy - fz * uz
            jx = fw * ux + fx * cosine + fy * uz - fz * uy
            jy = fw * uy - fx * uz + fy * cosine + fz * ux
            jz = fw * uz + fx * uy - fy * ux + fz * cosine
        # Times the quaternion before, and the product's rotation matrix.
        pw, px, py, pz = poses[k, 0], poses[k, 1], poses[k, 2], poses[k, 3]
        w = pw * jw - px * jx - py * jy - pz * jz
        x = pw * jx + px * jw + py * jz - pz * jy
        y = pw * jy - px * jz + py * jw + pz * jx
        z = pw * jz + px * jy - py * jx + pz * jw
        poses[c, 0], poses[c, 1], poses[c, 2], poses[c, 3] = w, x, y, z
        poses[c, 4] = 1.0 - 2.0 * (y * y + z * z)
        poses[c, 5] = 2.0 * (x * y - w * z)
        poses[c, 6] = 2.0 * (x * z + w * y)
        poses[c, 7] = 2.0 * (x * y + w * z)
        poses[c, 8] = 1.0 - 2.0 * (x * x + z * z)
        poses[c, 9] = 2.0 * (y * z - w * x)
        poses[c, 10] = 2.0 * (x * z - w * y)
        poses[c, 11] = 2.0 * (y * z + w * x)
        poses[c, 12] = 1.0 - 2.0 * (x * x + y * y)
        if prismatic[k]:
            ax, ay, az = rotated(poses, c, ax, ay, az)
            poses[c, 13] += configurations[row, k] * ax
            poses[c, 14] += configurations[row, k] * ay
            poses[c, 15] += configurations[row, k] * az


@inlined
def to_world(poses: Array, frame: int, x: float, y: float, z: float) -> Vector:
    """Map a point of a joint frame to the world."""
    return (
        poses[frame, 13] + (poses[frame, 4] * x + poses[frame, 5] * y + poses[frame, 6] * z),
        poses[frame, 14] + (poses[frame, 7] * x + poses[frame, 8] * y + poses[frame, 9] * z),
        poses[frame, 15] + (poses[frame, 10] * x + poses[frame, 11] * y + poses[frame, 12] * z),
    )


@inlined
def rotated(poses: Array, frame: int, x: float, y: float, z: float) -> Vector:
    """Turn a vector of a joint frame into the world's."""
    if frame == 0:
        return x, y, z
    return (
        poses[frame, 4] * x + poses[frame, 5] * y + poses[frame, 6] * z,
        poses[frame, 7] * x + poses[frame, 8] * y + poses[frame, 9] * z,
        poses[frame, 10] * x + poses[frame, 11] * y + poses[frame, 12] * z,
    )


@inlined
def rotated_back(poses: Array, frame: int, x: float, y: float, z: float) -> Vector:
    """Turn a vector of the world into a joint frame's."""
    return (
        poses[frame, 4] * x + poses[frame, 7] * y + poses[frame, 10] * z,
        poses[frame, 5] * x + poses[frame, 8] * y + poses[frame, 11] * z,
        poses[frame, 6] * x + poses[frame, 9] * y + poses[frame, 12] * z,
    )


@inlined
def to_frame(poses: Array, frame: int, point: Vector) -> Vector:
    """Map a point of the world to a frame."""
    x, y, z = point[0] - poses[frame, 13], point[1] - poses[frame, 14], point[2] - poses[frame, 15]
    return rotated_back(poses, frame, x, y, z)


@inlined
def place_bodies(placed: Array, poses: Array) -> None:
    """Fill in the rows of the scene's bodies, which come last."""
    first = poses.shape[0] - placed.shape[0]
    for body in range(placed.shape[0]):
        for i in range(POSE):
            poses[first + body, i] = placed[body, i]


@inlined
def point_jacobian(chain: Chain, poses: Array, point: Vector, jacobian: Array) -> None:
    """Fill in a point's speed per unit speed of each of the first joints [m/rad, or m/m].

    It lies beyond them, and all is in the world. A Jacobian of the shape (6, n), rather than
    (3, n), also has the angular velocities of the point's link.
    """
    prismatic, axis = chain.prismatic, chain.axis
    for k in range(jacobian.shape[1]):
        c = k + 1
        wx, wy, wz = rotated(poses, c, axis[k, 0], axis[k, 1], axis[k, 2])
        if prismatic[k]:
            jacobian[0, k], jacobian[1, k], jacobian[2, k] = wx, wy, wz
        else:
            rx, ry, rz = point[0] - poses[c, 13], point[1] - poses[c, 14], point[2] - poses[c, 15]
            jacobian[0, k] = wy * rz - wz * ry
            jacobian[1, k] = wz * rx - wx * rz
            jacobian[2, k] = wx * ry - wy * rx
        if jacobian.shape[0] == 6:
            turns = 0.0 if prismatic[k] else 1.0
            jacobian[3, k], jacobian[4, k], jacobian[5, k] = turns * wx, turns * wy, turns * wz


@kernel
def follow_tool(
    first: int, last: int, chain: Chain, placement: Array, configurations: Array, filled: Array
) -> None:
    """Write where the tool frame is at some configurations.

    Parameters
    ----------
    first, last, chain
        Range of the rows, and the arm.
    placement : ndarray, shape (4, 4)
        The tool frame in that of the last joint [m].
    configurations : ndarray, shape (n, n_joints)
        Joint positions [rad or m].
    filled : ndarray, shape (n, 4, 4)
        Where its poses in the world go [m].
    """
    joint = configurations.shape[1]
    poses = np.zeros((joint + 1, POSE))
    for row in range(first, last):
        forward_kinematics(chain, configurations, row, poses)
        point = to_world(poses, joint, placement[0, 3], placement[1, 3], placement[2, 3])
        for k in range(3):
            x, y, z = placement[0, k], placement[1, k], placement[2, k]
            x, y, z = rotated(poses, joint, x, y, z)
            filled[row, 0, k], filled[row, 1, k], filled[row, 2, k] = x, y, z
            filled[row, 3, k] = 0.0
        filled[row, 0, 3], filled[row, 1, 3], filled[row, 2, 3] = point
        filled[row, 3, 3] = 1.0
