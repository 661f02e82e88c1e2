"""Records: named tuples and work space that kernels find by one address."""

import copy
import pickle
from typing import NamedTuple

import numpy as np
import pytest
from numba import njit, types

from kinarm.kernels.compiling import inlined, lean_kernel
from kinarm.kernels.lanes import LANES, as_numbers, lanes
from kinarm.kernels.records import CACHE_LINE, Fixed, Layout, recorded


class Inner(NamedTuple):
    numbers: np.ndarray
    flags: np.ndarray


class Outer(NamedTuple):
    inner: Inner
    count: int
    factor: float
    empty: np.ndarray


def outer():
    inner = Inner(np.arange(24.0).reshape(2, 3, 4), np.array([True, False]))
    return Outer(inner, -7, 0.1, np.zeros((0, 5), dtype=np.int64))


def as_record(values):
    return recorded(values._replace(inner=recorded(values.inner)))


@inlined
def read(values):
    numbers = values.inner.numbers
    total = 0.0
    for i in range(numbers.shape[0]):
        for j in range(numbers.shape[1]):
            row = numbers[i, j]
            for k in range(row.shape[0]):
                total += row[k] * (i + 10 * j + 100 * k)
    shape, first = values.empty.shape, values.inner.flags[0]
    return total, numbers.shape, shape, first, values.count * values.factor


@lean_kernel
def read_all(values):
    return read(values)


@lean_kernel
def write(values):
    values.inner.numbers[1, 2, 3] = -1.0


def test_kernels_read_records_as_they_read_named_tuples():
    assert read_all(as_record(outer())) == read_all(outer())


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_copies_have_arrays_of_their_own(copied):
    record = as_record(outer())
    other = copied(record)
    write(other)
    assert other.inner.numbers[1, 2, 3] == -1.0
    assert record.inner.numbers[1, 2, 3] == 23.0
    assert read_all(record) == read_all(outer())


def test_records_of_one_form_share_a_type():
    record, other = as_record(outer()), as_record(outer())
    assert record._numba_type_ is other._numba_type_
    flat = recorded(Inner(np.zeros(3), np.zeros(2, dtype=bool)))
    assert flat._numba_type_ != record.inner._numba_type_


def test_arrays_with_gaps_are_refused():
    with pytest.raises(TypeError):
        recorded(Inner(np.zeros((4, 4))[:, ::2], np.zeros(2, dtype=bool)))


@njit
def fill(space):
    first, second, third = as_numbers(space.first), space.second, as_numbers(space.third)
    for lane in range(LANES):
        for i in range(first.shape[0]):
            for j in range(first.shape[1]):
                first[i, j, lane] = 1.0
        third[0, lane] = 3.0
    for i in range(second.shape[0]):
        for j in range(second.shape[1]):
            second[i, j] = 2
    return first.shape, second.shape, third.shape


@pytest.mark.parametrize("n", [0, 1, 4])
def test_arrays_of_a_layout_lie_side_by_side(n):
    shapes = {"first": (lanes, (n, 2)), "second": (types.int64, (3, n)), "third": (lanes, (1,))}
    layout = Layout("Space", shapes)
    space, other = layout.record(), layout.record()
    assert fill(space) == ((n, 2, LANES), (3, n), (1, LANES))
    counts = [2 * n * LANES, 3 * n, LANES]
    first = -space.values.ctypes.data % CACHE_LINE // 8
    words = space.values.view(np.int64)[first : first + sum(counts)]
    one, three = np.array([1.0, 3.0]).view(np.int64)
    expected = np.repeat([one, 2, three], counts)
    np.testing.assert_array_equal(words, expected)
    assert not other.values.any()


def test_lengths_that_are_fixed_belong_to_the_type():
    shapes = [{"numbers": (types.float64, (2, last))} for last in (3, Fixed(3), Fixed(4))]
    free, fixed, other = (Layout("Space", shape) for shape in shapes)
    assert len({layout.record()._numba_type_ for layout in (free, fixed, other)}) == 3

    @njit
    def shape(space):
        return space.numbers.shape

    assert shape(free.record()) == shape(fixed.record()) == (2, 3)
