"""The work space of a block: arrays that lie side by side in one buffer, which they fill."""

import numpy as np
import pytest
from numba import njit

from kinarm.kernels.block import numbers_needed, work_space
from kinarm.kernels.carving import carve_lanes, carve_numbers
from kinarm.kernels.lanes import LANES, as_numbers

SIZES = [(6, 5, 48, 28, 5, 1, 245, 48), (7, 7, 55, 60, 5, 256, 0, 0), (1, 1, 13, 0, 5, 1, 0, 13)]


@njit
def space_of(n_joints, n_actuated, n_observations, n_pairs, n_terms, widest, own, summed):
    block, alone = work_space(
        n_joints, n_actuated, n_observations, n_pairs, n_terms, widest, own, summed
    )
    needed = numbers_needed(
        n_joints, n_actuated, n_observations, n_pairs, n_terms, widest, own, summed
    )
    first, last = as_numbers(block.q).ctypes.data, alone.simplex.ctypes.data
    return needed, (last - first) // 8 + alone.simplex.size


@pytest.mark.parametrize("sizes", SIZES)
def test_arrays_fill_their_buffer(sizes):
    n_joints, n_actuated, n_observations, n_pairs, n_terms, widest, own, summed = sizes
    needed, taken = space_of(
        n_joints, n_actuated, n_observations, n_pairs, n_terms, widest, own, summed
    )
    assert needed == taken


@njit
def carve_three(buffer, used, n):
    first = as_numbers(carve_lanes(buffer, used, (n, 2)))
    second = carve_numbers(buffer, used, (3, n))
    third = as_numbers(carve_lanes(buffer, used, (1,)))
    first[:], second[:], third[:] = 1.0, 2.0, 3.0
    return first.shape, second.shape, third.shape


@pytest.mark.parametrize("n", [0, 1, 4])
def test_arrays_lie_side_by_side(n):
    buffer, used = np.zeros(100), np.zeros(1, dtype=np.int64)
    assert carve_three(buffer, used, n) == ((n, 2, LANES), (3, n), (1, LANES))
    counts = [2 * n * LANES, 3 * n, LANES]
    assert used[0] == sum(counts)
    np.testing.assert_array_equal(buffer[: used[0]], np.repeat([1.0, 2.0, 3.0], counts))
    assert not buffer[used[0] :].any()


def test_a_carved_array_keeps_its_buffer():
    @njit
    def carved():
        buffer, used = np.zeros(1000), np.zeros(1, dtype=np.int64)
        array = carve_numbers(buffer, used, (10, 100))
        array[:] = 7.0
        return array

    kept = [carved() for _ in range(50)]
    assert all((array == 7.0).all() for array in kept)
