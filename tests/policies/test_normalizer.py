"""Running statistics against numpy's, over all the data at once."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinarm.policies.normalizer import Normalizer, input_scale


def add(normalizer, episodes):
    """Add observations, a list of arrays of shape (steps, n), episode by episode."""
    centred = [episode - normalizer.mean for episode in episodes]
    moments = np.array([[part.sum(axis=0), (part**2).sum(axis=0)] for part in centred])
    return normalizer.updated(moments, np.array([len(part) for part in episodes]))


@settings(max_examples=50)
@given(
    st.integers(0, 2**32 - 1),
    st.lists(st.lists(st.integers(1, 30), min_size=1, max_size=4), min_size=1, max_size=5),
)
def test_equals_the_statistics_of_all_observations(seed, batches):
    rng = np.random.default_rng(seed)
    offset, scale = rng.normal(size=4) * 10, 10.0 ** rng.uniform(-3, 2, 4)
    normalizer, seen = Normalizer.empty(4), []
    for lengths in batches:
        episodes = [offset + scale * rng.normal(size=(length, 4)) for length in lengths]
        normalizer = add(normalizer, episodes)
        seen += episodes
    data = np.concatenate(seen)
    assert normalizer.count == len(data)
    np.testing.assert_allclose(normalizer.mean, data.mean(axis=0), rtol=1e-9)
    np.testing.assert_allclose(normalizer.std, data.std(axis=0), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("value", [0.325, 1e3, -1e6, 0.0])
def test_constant_inputs_get_weight_zero(value):
    normalizer = Normalizer.empty(2)
    rng = np.random.default_rng(0)
    for _ in range(50):
        episodes = [np.column_stack([np.full(64, value), rng.normal(size=64)]) for _ in range(8)]
        normalizer = add(normalizer, episodes)
    scale = input_scale(normalizer.std)
    assert scale[0] == 0
    assert scale[1] == pytest.approx(1, rel=0.1)


def test_scale_is_the_inverse_deviation():
    np.testing.assert_array_equal(input_scale(np.array([2.0, 0.5, 0.0, 1e-7])), [0.5, 2, 0, 0])
