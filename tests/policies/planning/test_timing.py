"""Time laws: limits, ends and ways, by samples of a millisecond and by hand."""

import itertools
import math

import numpy as np
import pytest

from kinarm.policies.planning.motions import Motions
from kinarm.policies.planning.settings import Limits
from kinarm.policies.planning.timing import largest, trajectory_of
from kinarm.problem import PROBLEMS
from kinarm.scene import Scene
from kinarm.world import World

VELOCITY = np.array([3.0, 2.0, 4.0, 5.0, 5.0, 8.0])
LIMITS = Limits(VELOCITY, 3.0 * VELOCITY, 40.0 * VELOCITY)


@pytest.fixture(scope="module")
def motions():
    """The default arm above the ground."""
    return Motions(World(PROBLEMS["both"].replace(scene=Scene(obstacles=())), threads=1))


def polyline(seed, corners):
    return 0.3 * np.random.default_rng(seed).normal(size=(corners, 6))


def sampled(trajectory, rate=1000):
    times = np.append(np.arange(0.0, trajectory.duration, 1 / rate), trajectory.duration)
    return [trajectory.at(times, derivative) for derivative in range(4)]


@pytest.mark.parametrize("seed", range(8))
def test_limits_hold_on_the_dense_motion(motions, seed):
    path = polyline(seed, 2 + seed)
    trajectory = trajectory_of(path, LIMITS, motions)
    q, *derivatives = sampled(trajectory)
    np.testing.assert_allclose(q[[0, -1]], path[[0, -1]], rtol=0, atol=1e-12)
    for derivative in derivatives[:2]:
        np.testing.assert_allclose(derivative[[0, -1]], 0, atol=1e-9)
    for derivative, limit in zip(derivatives, LIMITS, strict=True):
        assert (np.abs(derivative) <= limit * (1 + 1e-9)).all()
    # The derivatives are those of the positions: by differences of them, limits hold as well.
    differences, dt = q[:-1], 1e-3
    for limit in LIMITS:
        differences = np.diff(differences, axis=0) / dt
        assert (np.abs(differences) <= limit * (1 + 1e-4) + 1e-6 / dt).all()
    for derivative, next_one in zip([q, *derivatives[:1]], derivatives[:2], strict=True):
        step = np.diff(derivative[:-1], axis=0)
        np.testing.assert_allclose(
            step / dt, next_one[:-2], atol=0.03 * LIMITS.jerk.max() * dt**0.5
        )


def test_straight_ways_are_straight_and_corners_are_rounded_nearby(motions):
    path = polyline(1, 5)
    q, velocity, *_ = sampled(trajectory_of(path, LIMITS, motions))
    ways = itertools.pairwise(path)
    fine = np.concatenate([a + np.linspace(0, 1, 3000)[:, None] * (b - a) for a, b in ways])
    off = np.array([np.abs(fine - each).max(axis=1).min() for each in q[::7]])
    assert np.median(off) < 1e-3
    assert off.max() < 0.25 * np.abs(np.diff(path, axis=0)).max()
    # It rests at its ends alone.
    assert (np.abs(velocity / VELOCITY).max(axis=1)[9:-9] > 1e-3).all()


def test_one_way_takes_what_its_slowest_joint_takes(motions):
    # Full speed is reached: the way at full speed, and half of both ramps.
    path = np.array([np.zeros(6), [3.0, 0.1, 0, 0, 0, 0]]) / 2
    ramp = 1 / 3.0 + 3.0 / 40.0
    assert trajectory_of(path, LIMITS, motions).duration == pytest.approx(0.5 + ramp, abs=1e-9)
    # So short that the jerk changes sign four times: each quarter covers a part of the way.
    short = np.array([np.zeros(6), [1e-3, 0, 0, 0, 0, 0]])
    quarter = (1e-3 / 3.0 / (2 * 40.0)) ** (1 / 3)
    assert trajectory_of(short, LIMITS, motions).duration == pytest.approx(4 * quarter, abs=1e-9)


def test_paths_without_length_take_no_time(motions):
    for path in (np.ones((1, 6)), np.ones((3, 6))):
        trajectory = trajectory_of(path, LIMITS, motions)
        assert trajectory.duration == 0.0
        np.testing.assert_array_equal(trajectory.at(np.zeros(1)), np.ones((1, 6)))


def test_it_rests_after_its_end(motions):
    path = polyline(3, 3)
    trajectory = trajectory_of(path, LIMITS, motions)
    late = trajectory.duration + np.array([1e-9, 0.01, 5.0])
    np.testing.assert_allclose(trajectory.at(late), path[[-1] * 3], rtol=0, atol=1e-12)
    for derivative in (1, 2):
        np.testing.assert_allclose(trajectory.at(late, derivative), 0, atol=1e-9)


def test_repeated_corners_count_for_nothing(motions):
    path = polyline(2, 4)
    once, twice = (trajectory_of(each, LIMITS, motions) for each in (path, path.repeat(2, axis=0)))
    assert twice.duration == once.duration


def test_largest_number_by_halving():
    assert largest(lambda x: x * x <= 2.0, 0.0, 2.0) == pytest.approx(math.sqrt(2.0), abs=1e-15)
    assert largest(lambda _: True, 0.0, 2.0) == 2.0
