"""Compiled closest points against exact distances."""

import math

import numpy as np
import pytest
from numba import njit

from kinarm.kernels.distance import between_segments, closest_to_box, depth_in

ORIGIN = (0.0, 0.0, 0.0)
UNIT = (1.0, 1.0, 1.0)


@njit
def depth(simplex):
    return depth_in(simplex)


@njit
def segment_gaps(a, b, c, d):
    gaps = np.empty(len(a))
    for i in range(len(a)):
        x, y, z = between_segments(
            (a[i, 0], a[i, 1], a[i, 2]),
            (b[i, 0], b[i, 1], b[i, 2]),
            (c[i, 0], c[i, 1], c[i, 2]),
            (d[i, 0], d[i, 1], d[i, 2]),
        )
        gaps[i] = math.sqrt(x * x + y * y + z * z)
    return gaps


@njit
def box_gaps(a, b, low, high):
    gaps = np.empty(len(a))
    for i in range(len(a)):
        t = closest_to_box(
            (a[i, 0], a[i, 1], a[i, 2]),
            (b[i, 0], b[i, 1], b[i, 2]),
            (low[i, 0], low[i, 1], low[i, 2]),
            (high[i, 0], high[i, 1], high[i, 2]),
        )
        point = a[i] + t * (b[i] - a[i])
        beyond = point - np.minimum(np.maximum(point, low[i]), high[i])
        gaps[i] = math.sqrt((beyond * beyond).sum())
    return gaps


def point_to_segment(p, a, b):
    """Distances of points from segments, arrays of shape (n, 3)."""
    u = b - a
    length = (u * u).sum(axis=1)
    t = ((p - a) * u).sum(axis=1) / np.where(length > 0, length, 1)
    return np.linalg.norm(p - a - np.clip(t, 0, 1)[:, None] * u, axis=1)


def segment_distances(a, b, c, d):
    """Exact distances of segments: the least over the ends and the common perpendicular."""
    ends = [
        point_to_segment(a, c, d),
        point_to_segment(b, c, d),
        point_to_segment(c, a, b),
        point_to_segment(d, a, b),
    ]
    least = np.min(ends, axis=0)
    u, v, w = b - a, d - c, c - a
    normal = np.cross(u, v)
    square = (normal * normal).sum(axis=1)
    skew = square > 1e-14
    safe = np.where(skew, square, 1)
    s = (np.cross(w, v) * normal).sum(axis=1) / safe
    t = (np.cross(w, u) * normal).sum(axis=1) / safe
    inside = skew & (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    across = np.abs((w * normal).sum(axis=1)) / np.sqrt(safe)
    return np.where(inside, np.minimum(least, across), least)


def box_distances(a, b, low, high):
    """Distances of segments from boxes, by ternary search of a convex function."""

    def distance(t):
        p = a + t[:, None] * (b - a)
        return np.linalg.norm(p - np.clip(p, low, high), axis=1)

    left, right = np.zeros(len(a)), np.ones(len(a))
    for _ in range(80):
        first, second = left + (right - left) / 3, right - (right - left) / 3
        nearer = distance(first) < distance(second)
        left, right = np.where(nearer, left, first), np.where(nearer, second, right)
    return np.min([distance(t) for t in (left, right, np.zeros(len(a)), np.ones(len(a)))], axis=0)


def rows(*points):
    return [np.array([p], dtype=float) for p in points]


class TestBetweenSegments:
    @pytest.mark.parametrize(
        ("segments", "expected"),
        [
            ([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], 1),
            ([(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)], 1),
            ([(0, 0, 0), (1, 0, 0), (3, 1, 0), (2, 1, 0)], math.sqrt(2)),
            ([(-1, 0, 0), (1, 0, 0), (0, -1, 0.5), (0, 1, 0.5)], 0.5),
            ([(0, 0, 0), (0, 0, 0), (3, 4, 0), (3, 4, 0)], 5),
            ([(0, 0, 0), (0, 0, 0), (-1, 2, 0), (1, 2, 0)], 2),
            ([(-1, 2, 0), (1, 2, 0), (0, 0, 0), (0, 0, 0)], 2),
            ([(-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0)], 0),
            ([(0, 0, 0), (2, 0, 0), (1, 0, 0), (3, 0, 0)], 0),
            ([(0, 0, 0), (1, 0, 0), (1, 0, 0), (2, 5, 0)], 0),
            ([(1, 1, 1), (1, 1, 1), (1, 1, 1), (1, 1, 1)], 0),
        ],
    )
    def test_hand_computed(self, segments, expected):
        assert segment_gaps(*rows(*segments))[0] == pytest.approx(expected, abs=1e-12)

    def test_is_close_for_random_parallel_degenerate_and_nearly_touching_segments(self):
        rng, n = np.random.default_rng(8), 60_000
        a, b, c, d = rng.normal(size=(4, 4 * n, 3))
        parallel, touching = slice(n), slice(n, 2 * n)
        factor = rng.uniform(-1.5, 1.5, (n, 1))
        factor[:20_000] = 0
        d[parallel] = (c + np.concatenate([factor, np.zeros((3 * n, 1))]) * (b - a))[parallel]
        b[10_000:30_000] = a[10_000:30_000]
        met = (a + rng.random((4 * n, 1)) * (b - a))[touching]
        met += 10.0 ** rng.uniform(-14, -1, (n, 1)) * rng.normal(size=(n, 3))
        d[touching] = met + rng.random((n, 1)) * (met - c[touching])
        gaps, distances = segment_gaps(a, b, c, d), segment_distances(a, b, c, d)
        assert np.abs(distances - gaps).max() < 1e-6


class TestClosestToBox:
    @pytest.mark.parametrize(
        ("segment", "expected"),
        [
            ([(0, 0, 2), (1, 0, 2)], 1),
            ([(2, 2, 0.5), (3, 3, 0.5)], math.sqrt(2)),
            ([(2, 2, 2), (2, 2, 2)], math.sqrt(3)),
            ([(-1, 0.5, 1.5), (2, 0.5, 1.5)], 0.5),
            ([(2, -1, 0.5), (-1, 2, 0.5)], 0),
            ([(0.5, 0.5, 0.5), (5, 5, 5)], 0),
            ([(1, 1, 1), (2, 2, 2)], 0),
            ([(0, 0, 1), (1, 1, 1)], 0),
            ([(0, 0, 0), (0, 0, 0)], 0),
            ([(0.5, 0.5, 1 + 1e-9), (0.7, 0.5, 1 + 1e-9)], 1e-9),
            ([(3, 0.5, 0.5), (0, 3.5, 0.5)], 1.5 / math.sqrt(2)),
        ],
    )
    def test_hand_computed(self, segment, expected):
        gap = box_gaps(*rows(*segment, ORIGIN, UNIT))[0]
        assert gap == pytest.approx(expected, abs=1e-9)

    @pytest.mark.parametrize("where", ["anywhere", "near the box", "along faces"])
    def test_is_close(self, where):
        rng, n = np.random.default_rng(11), 50_000
        low, high = np.zeros((n, 3)), np.ones((n, 3))
        a, b = rng.uniform(-1, 2, (2, n, 3))
        if where == "anywhere":
            a, b, low = 3 * a, 3 * b, rng.uniform(-1, 0.9, (n, 3))
        elif where == "near the box":
            middle = np.clip(a, 0, 1) + 10.0 ** rng.uniform(-12, -1, (n, 1)) * rng.normal(size=3)
            a, b = middle - rng.random((n, 1)) * b, middle + rng.random((n, 1)) * b
        else:
            b[: n // 2, 1:] = a[: n // 2, 1:]
            b[n // 2 :] = a[n // 2 :]
        gaps, distances = box_gaps(a, b, low, high), box_distances(a, b, low, high)
        assert np.abs(distances - gaps).max() < 1e-6


@pytest.mark.parametrize(
    ("corners", "exact"),
    [
        ([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], 3**-0.5),
        ([(0, 0, 3), (1, 0, -0.1), (-1, 1, -0.1), (-1, -1, -0.1)], 0.1),
        ([(0, 0, 3), (1, 0, 0.1), (-1, 1, 0.1), (-1, -1, 0.1)], -0.1),
        ([(1, 0, 1e-9), (-1, 1, 0), (-1, -1, 0), (2, 0, -1e-9)], 0.0),
        ([(1, 0, 0), (1, 0, 0), (-1, -1, 0), (2, 0, -1)], 0.0),
    ],
)
def test_how_deep_the_origin_is_in_a_tetrahedron(corners, exact):
    for order in ([0, 1, 2, 3], [2, 0, 3, 1]):
        found = depth(np.array(corners, dtype=float)[order])
        assert found == pytest.approx(exact, abs=1e-8) if exact >= 0 else found < 0
