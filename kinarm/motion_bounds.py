"""Certified bounds on how far the joints of a chain can move its points."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.chain import Chain


class MotionBounds(NamedTuple):
    """Bounds of a chain's motion, for its first n joints.

    Attributes
    ----------
    curvature : ndarray, shape (n, n)
        Bound on the second derivative of the tool point p by two axes [m/rad^2], so that
        p(q + e) differs from p(q) + J e by at most half the sum of |e_i| |e_j| curvature_ij.
    swing : ndarray, shape (n, n)
        Bound on how fast a joint (row) moves the origin of a joint frame (column) [m/rad].
    length : ndarray, shape (n,)
        Bound on the distance from the origin of a joint frame to the tool point [m].
    """

    curvature: NDArray[np.float64]
    swing: NDArray[np.float64]
    length: NDArray[np.float64]

    @classmethod
    def of(cls, chain: Chain, n: int) -> "MotionBounds":
        """Bound the motion of a chain whose first n joints move.

        The derivative of a joint's motion by a revolute joint before it is its cross product with
        that joint, hence no longer than itself; a prismatic joint does not change it.
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
        lengths = link_lengths(chain)
        outward = np.append(np.cumsum(lengths[::-1])[::-1][1:], 0.0) + np.linalg.norm(chain.tool)
        return cls(curvature, swing, outward[:n].copy())


def link_lengths(chain: Chain) -> NDArray[np.float64]:
    """Bound on the distance from each joint frame's origin to that before it [m], shape (n,)."""
    slide = np.where(chain.prismatic, np.fmax(np.abs(chain.lower), np.abs(chain.upper)), 0.0)
    lengths: NDArray[np.float64] = np.linalg.norm(chain.translation, axis=1) + slide
    return lengths


def point_speed(chain: Chain, axis: int, link: int, points: NDArray[np.float64]) -> float:
    """Bound on the speed of points of a link per unit speed of a joint [m/rad, or m/m].

    A revolute joint moves a point by its distance from the axis. The joint after it starts at a
    fixed distance from the axis, and the links beyond add at most their lengths.

    Parameters
    ----------
    chain : Chain
        The arm's kinematics.
    axis, link : int
        The joint, counted from 0, and the link, counted from 1: link k is that of the k-th joint.
    points : ndarray, shape (n, 3)
        Points in the link's frame, for whose convex hull the bound holds [m].
    """
    if chain.prismatic[axis]:
        return 1.0
    if link == axis + 1:
        return float(np.linalg.norm(np.cross(chain.axis[axis], points), axis=1).max())
    following, lengths = chain.translation[axis + 1], link_lengths(chain)
    slide = lengths[axis + 1] - np.linalg.norm(following)
    offset = np.linalg.norm(np.cross(chain.axis[axis], following)) + slide
    between = lengths[axis + 2 : link].sum()
    return float(offset + between + np.linalg.norm(points, axis=1).max())
