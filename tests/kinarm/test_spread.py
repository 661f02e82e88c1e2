"""Evenly spread points."""

import numpy as np
import pytest
from scipy.stats import qmc

from kinarm.spread import evenly_spread


@pytest.mark.parametrize("dimensions", [1, 2, 3, 6, 7])
def test_shape_and_range(dimensions):
    points = evenly_spread(500, dimensions)
    assert points.shape == (500, dimensions)
    assert ((points >= 0) & (points < 1)).all()
    assert len(np.unique(points, axis=0)) == 500


def test_one_dimension_is_the_golden_ratio():
    golden = (np.sqrt(5) - 1) / 2
    expected = (0.5 + golden * np.arange(1, 30)) % 1
    np.testing.assert_allclose(evenly_spread(29, 1)[:, 0], expected, atol=1e-12)


def test_more_points_continue_the_sequence():
    np.testing.assert_array_equal(evenly_spread(10, 4), evenly_spread(99, 4)[:10])


@pytest.mark.parametrize("dimensions", [1, 2, 3, 6])
@pytest.mark.parametrize("count", [48, 512])
def test_is_more_even_than_chance(dimensions, count):
    chance = np.random.default_rng(10).random((8, count, dimensions))
    usual = np.mean([qmc.discrepancy(points) for points in chance])
    assert qmc.discrepancy(evenly_spread(count, dimensions)) < 0.5 * usual
