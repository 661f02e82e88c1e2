"""A serial chain as flat arrays: what the compiled kernels know of an arm."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray


class Chain(NamedTuple):
    """Kinematics of n joints in series, in the order base to tool.

    Attributes
    ----------
    prismatic : ndarray of bool, shape (n,)
        Whether a joint slides; else it turns.
    translation : ndarray, shape (n, 3)
        Origin of a joint frame in its parent joint frame [m].
    rotation : ndarray, shape (n, 4)
        Orientation of a joint frame at zero in its parent: quaternion (w, x, y, z).
    axis : ndarray, shape (n, 3)
        Unit vector of a joint's axis in its own frame.
    tool : ndarray, shape (3,)
        Tool point in the last joint frame [m].
    lower, upper : ndarray, shape (n,)
        Limits [rad or m].
    velocity_limits : ndarray, shape (n,)
        Velocity limits [rad/s or m/s].
    """

    prismatic: NDArray[np.bool_]
    translation: NDArray[np.float64]
    rotation: NDArray[np.float64]
    axis: NDArray[np.float64]
    tool: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    velocity_limits: NDArray[np.float64]

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return len(self.lower)

    @classmethod
    def from_model(cls, model: pin.Model, tool_frame: str) -> "Chain":
        """Extract the arrays from a Pinocchio model of a serial chain and its tool frame."""
        frame = model.frames[model.getFrameId(tool_frame, pin.FrameType.BODY)]
        placements = [model.jointPlacements[i] for i in range(1, model.njoints)]
        subspaces = np.array([_motion_subspace(model.joints[i]) for i in range(1, model.njoints)])
        prismatic = np.logical_not(np.any(subspaces[:, 3:], axis=1))
        return cls(
            prismatic=prismatic,
            translation=np.array([placement.translation for placement in placements]),
            # Pinocchio's order is x, y, z, w.
            rotation=np.array(
                [np.roll(pin.Quaternion(each.rotation).coeffs(), 1) for each in placements]
            ),
            axis=np.where(prismatic[:, None], subspaces[:, :3], subspaces[:, 3:]),
            tool=np.array(frame.placement.translation),
            lower=np.array(model.lowerPositionLimit),
            upper=np.array(model.upperPositionLimit),
            velocity_limits=np.array(model.velocityLimit),
        )


def _motion_subspace(joint: pin.JointModel) -> NDArray[np.float64]:
    """Direction of a joint's motion in its own frame: linear part, then angular, shape (6,)."""
    data = joint.createData()
    joint.calc(data, np.zeros(1))
    return np.array(data.S).reshape(6)
