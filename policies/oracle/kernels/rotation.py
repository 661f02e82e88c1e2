"""Rotation in proofs for boxes: directions of the tool's axes as further entries of a point.

A unit vector a of the tool's axis moves as a point at distance 1 from where all axes of joints
meet. At an angle t from the wanted one it is 2 sin(t / 2) away. The same holds of the three axes of
a rotation by t, if their distance is divided by the square root of 2. Multiplied by a weight, it is
a length that counts as that of the tool's point from its goal: a goal is reached where the larger
one is within the tolerance.
"""

import math
from typing import NamedTuple

from kinarm.chain import Chain
from kinarm.kernels.compiling import Array, helper, inlined
from kinarm.kernels.elementary import HALF_PI, sine_cosine
from kinarm.kernels.kinematics import rotated
from kinarm.kernels.lanes import select

ROOT_HALF = 0.70710678118654752440


class Turn(NamedTuple):
    """Rotations that are wanted of the tool.

    Attributes
    ----------
    axes, wanted : ndarray, shape (n_axes, 3)
        Unit vectors of the last joint frame, and directions wanted of them; none, one or three.
    weight : float
        Length that counts as 1 of the distance of axes [m].
    turning : ndarray, shape (n,)
        The weight for joints that turn the axes, 0 for others [m/rad].
    """

    axes: Array
    wanted: Array
    weight: float
    turning: Array


@inlined
def length_of(vector: Array) -> float:
    """Length of a vector of any number of entries."""
    square = 0.0 * vector[0]
    for k in range(vector.shape[0]):
        square += vector[k] * vector[k]
    return math.sqrt(square)


@inlined
def share_within(length: float, radius: float) -> float:
    """Share of a vector of a length that lies in a ball about its beginning."""
    return select(length > radius, radius / length, 1.0)


@inlined
def plus_axes(value: float, vector: Array, spin: Array, joint: int) -> float:
    """A value plus the product of a vector and a joint's column of the axes' Jacobian."""
    for k in range(spin.shape[0]):
        value += vector[k] * spin[k, joint]
    return value


@inlined
def scale_of(turn: Turn) -> float:
    """What each axis is multiplied by [m]."""
    return turn.weight * (ROOT_HALF if turn.axes.shape[0] > 1 else 1.0)


@helper
def turn_from_goal(turn: Turn, last: int, poses: Array, apart: Array) -> float:
    """Fill in vectors from the wanted to the tool's axes; return their length [m]."""
    scale = scale_of(turn)
    for b in range(turn.axes.shape[0]):
        ax, ay, az = turn.axes[b, 0], turn.axes[b, 1], turn.axes[b, 2]
        ax, ay, az = rotated(poses, last, ax, ay, az)
        apart[3 * b] = scale * (ax - turn.wanted[b, 0])
        apart[3 * b + 1] = scale * (ay - turn.wanted[b, 1])
        apart[3 * b + 2] = scale * (az - turn.wanted[b, 2])
    return length_of(apart)


@helper
def axes_jacobian(chain: Chain, turn: Turn, poses: Array, apart: Array, spin: Array) -> None:
    """Fill in the speed of the axes' entries per unit speed of each joint [m/rad]."""
    scale = scale_of(turn)
    for i in range(spin.shape[1]):
        c, turns = i + 1, 0.0 if turn.turning[i] == 0.0 else 1.0
        wx, wy, wz = rotated(poses, c, chain.axis[i, 0], chain.axis[i, 1], chain.axis[i, 2])
        for b in range(turn.axes.shape[0]):
            k = 3 * b
            ax = apart[k] + scale * turn.wanted[b, 0]
            ay = apart[k + 1] + scale * turn.wanted[b, 1]
            az = apart[k + 2] + scale * turn.wanted[b, 2]
            spin[k, i] = turns * (wy * az - wz * ay)
            spin[k + 1, i] = turns * (wz * ax - wx * az)
            spin[k + 2, i] = turns * (wx * ay - wy * ax)


@inlined
def turned_by(turn: Turn, half: Array) -> float:
    """Angle by which the joints of a box turn the axes at most [rad]."""
    total = 0.0 * half[0]
    for i in range(half.shape[0]):
        if turn.turning[i] > 0.0:
            total += half[i]
    return total


@helper
def angle_bound(turn: Turn, length: float, half: Array) -> float:
    """Lower bound of the axes' length over a box: the angle at its centre less the half-widths [m].

    A revolute joint turns the tool by no more than it moves.
    """
    sine = min(0.5 * length / turn.weight, 1.0)
    cosine = math.sqrt(1.0 - sine * sine)
    less_sine, less_cosine = sine_cosine(min(0.5 * turned_by(turn, half), HALF_PI))
    return 2.0 * turn.weight * (sine * less_cosine - cosine * less_sine)
