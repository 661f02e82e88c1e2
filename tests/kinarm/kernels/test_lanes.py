"""Arithmetic in lanes against NumPy's, element by element."""

import math

import numpy as np
import pytest
from numba import njit

from kinarm.kernels.lanes import LANES, any_lane, as_lanes, as_numbers, lane_bits, select


@njit
def arithmetic(x, y, results):
    a, b, found = as_lanes(x), as_lanes(y), as_lanes(results)
    found[0] = a[0] + b[0]
    found[1] = a[0] - 2.0 * b[0]
    found[2] = a[0] * b[0] / 3
    found[3] = -a[0]
    found[4] = min(a[0], b[0])
    found[5] = max(a[0], 0.25)
    found[6] = abs(a[0])
    found[7] = math.sqrt(abs(b[0]))
    found[8] = select(a[0] < b[0], a[0], 7.0)
    total = a[0]
    total += b[0]
    total *= 2.0
    found[9] = total


@njit
def masks(x, y):
    a, b = as_lanes(x)[0], as_lanes(y)[0]
    return (
        lane_bits(a < b),
        lane_bits(a <= b),
        lane_bits(a > b),
        lane_bits(a >= b),
        lane_bits(a == b),
        lane_bits(a != b),
        lane_bits((a < b) & ~(a < 0.0)),
        lane_bits((a < b) | (a < 0.0)),
        any_lane(a < b),
        any_lane(a < -1e9),
    )


@njit
def through_views(array):
    lanes = as_lanes(array)
    numbers = as_numbers(lanes)
    for i in range(lanes.shape[0]):
        lanes[i] = lanes[i] + 1.0
    numbers[1, 2] = 100.0
    return numbers.shape, numbers.sum()


def bits(condition):
    return int((condition * (1 << np.arange(LANES))).sum())


@pytest.fixture
def pair():
    rng = np.random.default_rng(1)
    x, y = rng.normal(size=(2, 1, LANES))
    y[0, 3] = x[0, 3]
    return x, y


def test_arithmetic(pair):
    x, y = pair
    results = np.empty((10, LANES))
    arithmetic(x, y, results)
    a, b = x[0], y[0]
    expected = [
        a + b,
        a - 2 * b,
        a * b / 3,
        -a,
        np.minimum(a, b),
        np.maximum(a, 0.25),
        np.abs(a),
        np.sqrt(np.abs(b)),
        np.where(a < b, a, 7),
        (a + b) * 2,
    ]
    np.testing.assert_array_equal(results, expected)


@pytest.mark.parametrize("bad", [None, np.nan])
def test_comparisons(pair, bad):
    x, y = pair
    if bad is not None:
        x[0, 5] = bad
    a, b = x[0], y[0]
    expected = [a < b, a <= b, a > b, a >= b, a == b, a != b]
    expected += [(a < b) & ~(a < 0), (a < b) | (a < 0)]
    found = masks(x, y)
    assert list(found[:8]) == [bits(condition) for condition in expected]
    assert found[8:] == (bool((a < b).any()), False)


def test_views_share_memory():
    array = np.arange(3.0 * LANES).reshape(3, LANES)
    expected = array + 1
    expected[1, 2] = 100
    shape, total = through_views(array)
    assert shape == array.shape
    assert total == expected.sum()
    np.testing.assert_array_equal(array, expected)
