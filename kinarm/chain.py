"""A serial chain as flat arrays, and motion bounds."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kinarm.errors import InvalidInputError

ROUNDING = 1e-6
"""How far configurations may lie beyond limits, as encoders and float32 put them [rad or m]."""


class Chain(NamedTuple):
    """Kinematics of n joints in series, from base to tool.

    Attributes
    ----------
    prismatic : ndarray of bool, shape (n,)
        Whether a joint slides.
    translation : ndarray, shape (n, 3)
        Origin of a joint frame in its parent joint frame [m].
    rotation : ndarray, shape (n, 4)
        Orientation of a joint frame at zero in its parent: quaternion (w, x, y,
        z).
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
        """Take the arrays from a serial Pinocchio model and its tool frame."""
        frame = model.frames[model.getFrameId(tool_frame, pin.FrameType.BODY)]
        placements = [model.jointPlacements[i] for i in range(1, model.njoints)]
        subspaces = np.array([_motion_subspace(model.joints[i]) for i in range(1, model.njoints)])
        prismatic = np.logical_not(np.any(subspaces[:, 3:], axis=1))
        return cls(
            prismatic=prismatic,
            translation=np.array([placement.translation for placement in placements]),
            rotation=np.array([quaternion_of(each.rotation) for each in placements]),
            axis=np.where(prismatic[:, None], subspaces[:, :3], subspaces[:, 3:]),
            tool=np.array(frame.placement.translation),
            lower=np.array(model.lowerPositionLimit),
            upper=np.array(model.upperPositionLimit),
            velocity_limits=np.array(model.velocityLimit),
        )

    def within_limits(
        self, name: str, configurations: NDArray[np.float64], joint_names: tuple[str, ...]
    ) -> NDArray[np.float64]:
        """Clip configurations that rounding put beyond the limits, and refuse those farther out.

        Raises InvalidInputError if one lies beyond a limit by more than `ROUNDING`.

        Parameters
        ----------
        name : str
            What they are, for messages.
        configurations : ndarray, shape (n_joints,) or (n, n_joints)
            Joint positions [rad or m].
        joint_names : tuple of str
            Names of the joints, for messages.
        """
        lower, upper = self.lower, self.upper
        if not ((configurations < lower) | (configurations > upper)).any():
            return configurations
        clipped = np.clip(configurations, lower, upper)
        beyond = np.abs(configurations - clipped) > ROUNDING
        if beyond.any():
            *row, joint = (int(index) for index in np.argwhere(beyond)[0])
            value = configurations[(*row, joint)]
            raise InvalidInputError(
                f"{name}{row or ''} lies outside the limits: {joint_names[joint]} at {value:.6g}, "
                f"{lower[joint]:.6g} to {upper[joint]:.6g} allowed"
            )
        return clipped


def quaternion_of(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quaternion w, x, y, z of a rotation matrix; Pinocchio's order is x, y, z, w."""
    return np.roll(pin.Quaternion(rotation).coeffs(), 1)


def _motion_subspace(joint: pin.JointModel) -> NDArray[np.float64]:
    """A joint's motion in its own frame: linear, then angular, shape (6,)."""
    data = joint.createData()
    joint.calc(data, np.zeros(1))
    return np.array(data.S).reshape(6)


class MotionBounds(NamedTuple):
    """Bounds of a chain's motion, for its first n joints.

    Attributes
    ----------
    curvature : ndarray, shape (n, n)
        Bound on the second derivative of the tool point p by two axes [m/rad^2]: p(q + e) differs
        from p(q) + J e by at most half the sum of |e_i| |e_j| curvature_ij.
    swing : ndarray, shape (n, n)
        Bound on the speed of a joint frame's origin (column) by a joint (row)
        [m/rad].
    length : ndarray, shape (n,)
        Bound on the distance from the origin of a joint frame to the tool point
        [m].
    """

    curvature: NDArray[np.float64]
    swing: NDArray[np.float64]
    length: NDArray[np.float64]

    @classmethod
    def of(cls, chain: Chain, n: int) -> "MotionBounds":
        """Bound the motion of a chain whose first n joints move.

        A revolute joint before a joint changes its motion by the cross product of both, which is no
        longer than the motion; a prismatic joint does not change it.
        """
        origin = np.zeros((1, 3))
        moved = range(n)
        speed = np.array([point_speed(chain, k, chain.n_joints, chain.tool[None]) for k in moved])
        i, j = np.indices((n, n))
        curvature = np.where(chain.prismatic[np.minimum(i, j)], 0.0, speed[np.maximum(i, j)])
        swing = np.array(
            [
                [point_speed(chain, i, k + 1, origin) if i <= k else 0.0 for k in range(n)]
                for i in range(n)
            ]
        )
        return cls(curvature, swing, lengths_to_tool(chain)[:n])


def length_of(vector: NDArray[np.float64]) -> float:
    """Length of a vector, without BLAS, of which `numpy.linalg.norm` would ask it."""
    return float(np.sqrt(np.square(vector).sum()))


def link_lengths(chain: Chain) -> NDArray[np.float64]:
    """Bound on the distance of each joint's origin from the one before [m], shape (n,)."""
    slide = np.where(chain.prismatic, np.fmax(np.abs(chain.lower), np.abs(chain.upper)), 0.0)
    lengths: NDArray[np.float64] = np.linalg.norm(chain.translation, axis=1) + slide
    return lengths


def lengths_to_tool(chain: Chain) -> NDArray[np.float64]:
    """Bound on the distance from each joint's origin to the tool point [m], shape (n,).

    A sum of links, two of which count as one if the joint between them turns: then their ends are
    farthest apart where they lie on opposite sides of its axis.
    """
    n, points = chain.n_joints, np.append(chain.translation, chain.tool[None], axis=0)
    links, slides = np.append(link_lengths(chain), length_of(chain.tool)), chain.prismatic
    found = np.append(np.full(n, np.inf), 0.0)
    for k in reversed(range(n)):
        found[k] = links[k + 1] + found[k + 1]
        if k + 2 <= n and not slides[k + 1 : k + 3].any():
            turned = pin.Quaternion(*chain.rotation[k + 1]).matrix() * points[k + 1][:, None]
            ends = np.array([-turned.sum(axis=0), points[k + 2]])
            along = (ends * chain.axis[k + 1]).sum(axis=1)
            aside = np.sqrt(np.square(np.cross(chain.axis[k + 1], ends)).sum(axis=1))
            both = length_of(np.array([along[1] - along[0], aside.sum()]))
            found[k] = min(found[k], both + found[k + 2])
    return found[:n]


def point_speed(chain: Chain, axis: int, link: int, points: NDArray[np.float64]) -> float:
    """Bound on the speed of points of a link per unit speed of a joint [m/rad, or m/m].

    A revolute joint moves a point by its distance from the axis: at most that
    of the next joint, and the lengths of the links beyond.

    Parameters
    ----------
    chain : Chain
        The arm's kinematics.
    axis, link : int
        The joint, from 0, and the link, from 1: link k is that of the k-th
        joint.
    points : ndarray, shape (n, 3)
        Points in the link's frame, whose convex hull is bounded [m].
    """
    if chain.prismatic[axis]:
        return 1.0
    if link == axis + 1:
        return float(np.linalg.norm(np.cross(chain.axis[axis], points), axis=1).max())
    following, lengths = chain.translation[axis + 1], link_lengths(chain)
    slide = lengths[axis + 1] - length_of(following)
    offset = length_of(np.cross(chain.axis[axis], following)) + slide
    between = lengths[axis + 2 : link].sum()
    return float(offset + between + np.linalg.norm(points, axis=1).max())
