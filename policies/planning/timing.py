"""Time laws of paths: how an arm moves along one within limits of velocity, acceleration and jerk.

The arm moves straight between corners, and rounds them where that is free of contact. Each motion
is a polynomial of time. On a straight way, the jerk is constant in each of up to seven, as in the
double-S law (Biagiotti and Melchiorri, 2008, section 3.4). In a rounded corner, the velocity goes
from one direction to the other by a smooth step: the acceleration begins and ends with zero.
"""

import math
from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from kinarm.kernels.compiling import Array
from kinarm.policies.planning.motions import Motions
from kinarm.policies.planning.settings import Limits

ALLOWANCE = 1e-3
"""How far a body may be from straight ways between points of a rounded corner [m]."""

SHARES = (0.45, 0.22, 0.1, 0.04)
"""Shares of the shorter side that are tried for the rounding of a corner."""


class Trajectory(NamedTuple):
    """Polynomials of time, one after the other.

    Attributes
    ----------
    ends : ndarray, shape (n,)
        When each ends [s].
    coefficients : ndarray, shape (n, 5, n_joints)
        Of the powers of the time since each began.
    """

    ends: Array
    coefficients: Array

    @property
    def duration(self) -> float:
        """Its duration [s]."""
        return float(self.ends[-1])

    def at(self, times: Array, derivative: int = 0) -> Array:
        """Positions at times, or derivatives of them, shape (k, n_joints); later, it rests."""
        which = np.fmin(np.searchsorted(self.ends, times, side="left"), len(self.ends) - 1)
        since = np.minimum(times, self.ends[-1]) - np.concatenate([[0.0], self.ends])[which]
        found = np.zeros((len(times), self.coefficients.shape[2]))
        for power in range(4, derivative - 1, -1):
            factor = math.perm(power, derivative)
            found = found * since[:, None] + factor * self.coefficients[which, power]
        return found


class Corner(NamedTuple):
    """How a corner is rounded: how far from it [s at full speed], and at which share of it."""

    reach: float
    speed: float


def trajectory_of(path: Array, limits: Limits, motions: Motions) -> Trajectory:
    """Move along a path from rest to rest.

    Parameters
    ----------
    path : ndarray, shape (m, n_joints)
        Corners of a path of free straight segments [rad or m].
    limits : Limits
        What the joints keep.
    motions : Motions
        Tells where corners may be rounded.
    """
    lengths = (np.abs(np.diff(path, axis=0)) / limits.velocity).max(axis=1)
    path = np.concatenate([path[:1], path[1:][lengths > 0.0]])
    lengths = lengths[lengths > 0.0]
    if len(lengths) == 0:
        rest = np.concatenate([path, np.zeros((4, path.shape[1]))])
        return Trajectory(np.zeros(1), rest[None])
    # Directions have the length that the fastest joint covers in a second at full speed.
    ways = np.diff(path, axis=0) / lengths[:, None]
    room = Motions(motions.world, motions.margin + ALLOWANCE)
    corners = [Corner(0.0, 0.0)]
    for k in range(1, len(lengths)):
        sides = min(lengths[k - 1], lengths[k])
        corners.append(_rounding(path[k], ways[k - 1], ways[k], sides, limits, room))
    corners.append(Corner(0.0, 0.0))
    straight = [
        length - before.reach - after.reach
        for length, before, after in zip(lengths, corners[:-1], corners[1:], strict=True)
    ]
    speeds = [corner.speed for corner in corners]
    for k in [*range(len(straight)), *reversed(range(len(straight)))]:
        fits = _fastest(min(speeds[k : k + 2]), straight[k], limits.along(ways[k]))
        speeds[k], speeds[k + 1] = min(speeds[k], fits), min(speeds[k + 1], fits)
    pieces = []
    for k, way in enumerate(ways):
        if corners[k].reach > 0.0:
            pieces.append(_rounded(path[k], ways[k - 1], way, corners[k].reach, speeds[k]))
        start = path[k] + corners[k].reach * way
        pieces += _straight(start, way, straight[k], speeds[k], speeds[k + 1], limits)
    durations, coefficients = zip(*pieces, strict=True)
    return Trajectory(np.cumsum(durations), np.array(coefficients))


def largest(holds: Callable[[float], bool], low: float, high: float) -> float:
    """Largest number for which a condition holds that holds for the low one and all below it."""
    if holds(high):
        return high
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def _ramp(first: float, second: float, acceleration: float, jerk: float) -> tuple[float, float]:
    """Durations of growing and of constant acceleration, from one speed to another [s]."""
    change = abs(second - first)
    growing = min(math.sqrt(change / jerk), acceleration / jerk)
    return growing, max(change / (jerk * growing) - growing, 0.0) if growing > 0.0 else 0.0


def ramp_length(first: float, second: float, acceleration: float, jerk: float) -> float:
    """Way in which a speed becomes another, at zero acceleration before and after."""
    growing, constant = _ramp(first, second, acceleration, jerk)
    return 0.5 * (first + second) * (2.0 * growing + constant)


def _fastest(first: float, length: float, bounds: tuple[float, float]) -> float:
    """Largest speed that another one becomes within a length."""
    return largest(lambda speed: ramp_length(first, speed, *bounds) <= length, first, 1.0)


def _straight(
    start: Array, way: Array, length: float, first: float, last: float, limits: Limits
) -> list[tuple[float, Array]]:
    """Polynomials of a straight motion between two speeds, as fast as limits allow."""
    bounds = limits.along(way)

    def both(speed: float) -> float:
        return ramp_length(first, speed, *bounds) + ramp_length(speed, last, *bounds)

    peak = largest(lambda speed: both(speed) <= length, max(first, last), 1.0)
    phases = []
    for before, after in ((first, peak), (peak, last)):
        growing, constant = _ramp(before, after, *bounds)
        jerk = math.copysign(bounds[1], after - before)
        phases += [(growing, jerk), (constant, 0.0), (growing, -jerk)]
    phases.insert(3, (max(length - both(peak), 0.0) / max(peak, 1e-12), 0.0))
    pieces, s, v, a = [], 0.0, first, 0.0
    for t, jerk in phases:
        if t > 0.0:
            along = np.array([0.0, v, a / 2.0, jerk / 6.0, 0.0])[:, None] * way
            along[0] = start + s * way
            pieces.append((t, along))
            s += t * (v + t * (a / 2.0 + t * jerk / 6.0))
            v, a = v + t * (a + t * jerk / 2.0), a + t * jerk
    return pieces


def _rounding(
    corner: Array, before: Array, after: Array, side: float, limits: Limits, room: Motions
) -> Corner:
    """The largest rounding of a corner that is free of contact, and the speed in it."""
    turn = np.abs(after - before)
    for share in SHARES:
        reach = share * side
        _, curve = _rounded(corner, before, after, reach, 1.0)
        # Between points of the curve the joints are off by an eighth of their acceleration.
        off = float((room.farthest * turn[: room.moved]).sum()) * 0.375 * reach
        n = max(1, math.ceil(math.sqrt(off / ALLOWANCE)))
        ends = np.array([2.0 * reach])
        points = Trajectory(ends, curve[None]).at(np.arange(n + 1) / n * ends)
        if all(room.is_free(*way) for way in pairwise(points)):

            def holds(speed: float, reach: float = reach) -> bool:
                duration = 2.0 * reach / speed
                bent, jerk = 1.5 * speed * turn / duration, 6.0 * speed * turn / duration**2
                return bool((bent <= limits.acceleration).all() and (jerk <= limits.jerk).all())

            return Corner(reach, largest(holds, 1e-6, 1.0))
    return Corner(0.0, 0.0)


def _rounded(
    corner: Array, before: Array, after: Array, reach: float, speed: float
) -> tuple[float, Array]:
    """Duration and polynomial of a rounded corner.

    The velocity turns by a smooth step 3 s^2 - 2 s^3 of the share s of the duration.
    """
    duration, turn = 2.0 * reach / speed, speed * (after - before)
    start = corner - reach * before
    cubic, quartic = turn / duration**2, -0.5 * turn / duration**3
    return duration, np.array([start, speed * before, 0.0 * turn, cubic, quartic])
