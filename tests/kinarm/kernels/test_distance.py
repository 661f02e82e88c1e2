"""Compiled closest points against exact distances."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numba import njit

from kinarm.kernels.distance import between_segments, closest_to_box

coordinate = st.floats(-2, 2, allow_subnormal=False).map(lambda x: round(x, 9))
point = st.tuples(coordinate, coordinate, coordinate)
edge = st.floats(0.01, 2)

ORIGIN = (0.0, 0.0, 0.0)
UNIT = (1.0, 1.0, 1.0)


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

    @settings(max_examples=300)
    @example(ORIGIN, UNIT, ORIGIN, UNIT)
    @example(ORIGIN, UNIT, (0.0, 0.0, 1e-9), (1.0, 1.0, 1.0 + 1e-9))
    @given(point, point, point, point)
    def test_is_close_to_the_distance(self, a, b, c, d):
        segments = rows(a, b, c, d)
        assert abs(segment_gaps(*segments)[0] - segment_distances(*segments)[0]) < 1e-6

    @settings(max_examples=200)
    @given(point, point, point, st.floats(-1.5, 1.5), st.floats(0, 1e-6))
    def test_is_close_for_nearly_parallel_segments(self, a, b, c, factor, skew):
        d = tuple(c[i] + factor * (b[i] - a[i]) + skew * (i == 0) for i in range(3))
        segments = rows(a, b, c, d)
        assert abs(segment_gaps(*segments)[0] - segment_distances(*segments)[0]) < 1e-6

    def test_is_close_for_many_random_segments(self):
        a, b, c, d = np.random.default_rng(8).normal(size=(4, 200_000, 3))
        gaps, distances = segment_gaps(a, b, c, d), segment_distances(a, b, c, d)
        assert np.abs(distances - gaps).max() < 1e-6

    def test_is_close_for_parallel_and_degenerate_segments(self):
        rng = np.random.default_rng(9)
        a, b, c = rng.normal(size=(3, 60_000, 3))
        factor = rng.uniform(-1.5, 1.5, (60_000, 1))
        factor[:20_000] = 0
        d = c + factor * (b - a)
        b[10_000:30_000] = a[10_000:30_000]
        gaps, distances = segment_gaps(a, b, c, d), segment_distances(a, b, c, d)
        assert np.abs(distances - gaps).max() < 1e-6

    def test_is_close_for_segments_that_nearly_touch(self):
        rng = np.random.default_rng(10)
        a, b, c = rng.normal(size=(3, 60_000, 3))
        on_first = a + rng.random((60_000, 1)) * (b - a)
        apart = 10.0 ** rng.uniform(-14, -1, (60_000, 1)) * rng.normal(size=(60_000, 3))
        d = on_first + apart + rng.random((60_000, 1)) * (on_first + apart - c)
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
            ([(3, 0.5, 0.5), (0, 3.5, 0.5)], 1.5 / math.sqrt(2)),
        ],
    )
    def test_hand_computed(self, segment, expected):
        gap = box_gaps(*rows(*segment, ORIGIN, UNIT))[0]
        assert gap == pytest.approx(expected, abs=1e-9)

    @settings(max_examples=300)
    @example(ORIGIN, ORIGIN, ORIGIN, UNIT)
    @example((0.5, 0.5, 1.0 + 1e-9), (0.7, 0.5, 1.0 + 1e-9), ORIGIN, UNIT)
    @given(point, point, point, st.tuples(edge, edge, edge))
    def test_is_close_to_the_distance(self, a, b, low, edges):
        high = tuple(low[i] + edges[i] for i in range(3))
        shapes = rows(a, b, low, high)
        assert abs(box_gaps(*shapes)[0] - box_distances(*shapes)[0]) < 1e-6

    def test_is_close_for_many_random_segments(self):
        rng = np.random.default_rng(11)
        a, b = rng.normal(size=(2, 100_000, 3))
        low = rng.uniform(-1, 0, (100_000, 3))
        high = low + rng.uniform(0.05, 1, (100_000, 3))
        gaps, distances = box_gaps(a, b, low, high), box_distances(a, b, low, high)
        assert np.abs(distances - gaps).max() < 1e-6

    def test_is_close_near_faces_edges_and_corners(self):
        rng = np.random.default_rng(12)
        n = 100_000
        low, high = np.zeros((n, 3)), np.ones((n, 3))
        on_box = np.clip(rng.uniform(-1, 2, (n, 3)), 0, 1)
        apart = 10.0 ** rng.uniform(-12, -1, (n, 1)) * rng.normal(size=(n, 3))
        direction = rng.normal(size=(n, 3))
        a = on_box + apart - rng.random((n, 1)) * direction
        b = on_box + apart + rng.random((n, 1)) * direction
        gaps, distances = box_gaps(a, b, low, high), box_distances(a, b, low, high)
        assert np.abs(distances - gaps).max() < 1e-6

    def test_segments_along_faces_and_zero_length_segments(self):
        rng = np.random.default_rng(13)
        n = 50_000
        low, high = np.zeros((n, 3)), np.ones((n, 3))
        a = rng.uniform(-1, 2, (n, 3))
        b = a.copy()
        b[: n // 2, 0] += rng.normal(size=n // 2)
        gaps, distances = box_gaps(a, b, low, high), box_distances(a, b, low, high)
        assert np.abs(distances - gaps).max() < 1e-6
