"""Random streams by name, and points of low discrepancy."""

from itertools import product

import numpy as np
import pytest
from scipy.stats import qmc

from kinarm.evaluation.trials import trial_generator
from kinarm.policies.ars.algorithm import ARSTraining
from kinarm.policies.recipes import recipe
from kinarm.randomness import Stream, low_discrepancy_points, stream_generator


def test_a_stream_is_what_it_was():
    """Its numbers are part of what a seed means."""
    first = [stream_generator(stream, 7, 3).integers(1 << 32) for stream in Stream]
    assert first == [482907703, 3422100537, 4029689759]


@pytest.mark.parametrize("draw", ["random", "standard_normal"])
def test_no_two_purposes_share_numbers(draw):
    seeds, numbers = range(4), range(20)
    generators = [
        *(stream_generator(*each) for each in product(Stream, seeds, numbers)),
        *(stream_generator(*each) for each in product(Stream, seeds)),
        *(trial_generator(*each) for each in product(seeds, numbers, (0, 1))),
    ]
    first = {getattr(generator, draw)() for generator in generators}
    assert len(first) == len(generators)


def test_a_training_of_ars_begins_with_its_stream():
    config = recipe("ars", "paper", problem="right", seed=5)
    begun = stream_generator(Stream.ARS, 5).bit_generator.state
    assert ARSTraining(config, threads=1).initial_state().generator == begun


def test_one_dimension_is_the_golden_ratio():
    golden = (np.sqrt(5) - 1) / 2
    expected = (0.5 + golden * np.arange(1, 30)) % 1
    np.testing.assert_allclose(low_discrepancy_points(29, 1)[:, 0], expected, atol=1e-12)


@pytest.mark.parametrize("dimensions", [1, 2, 3, 6, 7])
@pytest.mark.parametrize("count", [48, 512])
def test_is_in_the_unit_cube_and_more_even_than_chance(dimensions, count):
    chance = np.random.default_rng(10).random((8, count, dimensions))
    usual = np.mean([qmc.discrepancy(points) for points in chance])
    points = low_discrepancy_points(count, dimensions)
    assert points.shape == (count, dimensions)
    assert qmc.discrepancy(points) < 0.5 * usual  # which refuses points outside the unit cube
    np.testing.assert_array_equal(low_discrepancy_points(10, dimensions), points[:10])
