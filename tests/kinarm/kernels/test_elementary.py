"""Elementary functions against exact ones, and a lane against a number, bit by bit."""

from fractions import Fraction

import numpy as np
import pytest
from numba import njit

from kinarm.kernels.elementary import exponential, hyperbolic_tangent, nearest_whole, sine_cosine
from kinarm.kernels.lanes import LANES, as_lanes


def evaluator(function):
    """A kernel that evaluates a function number by number and in lanes."""

    @njit
    def evaluate(values):
        numbers, many = np.empty_like(values), np.empty_like(values)
        given = as_lanes(values.reshape(-1, LANES))
        found = as_lanes(many.reshape(-1, LANES))
        for i in range(len(values)):
            numbers[i] = function(values[i])
        for i in range(len(given)):
            found[i] = function(given[i])
        return numbers, many

    return evaluate


KERNELS = [
    evaluator(njit(lambda x: sine_cosine(x)[0])),
    evaluator(njit(lambda x: sine_cosine(x)[1])),
    evaluator(exponential),
    evaluator(hyperbolic_tangent),
]


@njit
def rounded(values):
    return np.array([nearest_whole(value) for value in values])


def spread(largest, count=80_000):
    """Numbers of all sizes up to one, of both signs."""
    rng = np.random.default_rng(0)
    sizes = np.concatenate(
        [largest * rng.random(count // 2), largest * 10.0 ** rng.uniform(-12, 0, count // 2)]
    )
    return sizes * rng.choice([-1.0, 1.0], count)


EXACT = {0: np.sin, 1: np.cos, 2: np.exp, 3: np.tanh}


@pytest.mark.parametrize(
    ("which", "largest", "absolute", "relative"),
    [(0, 1e4, 1e-15, 0), (1, 1e4, 1e-15, 0), (2, 700, 0, 4e-16), (3, 30, 0, 5e-16)],
)
def test_as_precise_as_stated(which, largest, absolute, relative):
    x = spread(largest)
    exact = EXACT[which](x.astype(np.longdouble))
    error = np.abs(KERNELS[which](x)[0].astype(np.longdouble) - exact)
    assert (error <= absolute + relative * np.abs(exact)).all()


@pytest.mark.parametrize("which", range(4))
def test_lanes_have_the_bits_of_numbers(which):
    x = spread(300.0)
    numbers, many = KERNELS[which](x)
    np.testing.assert_array_equal(numbers.view(np.int64), many.view(np.int64))


@pytest.mark.parametrize("which", range(4))
def test_special_values(which):
    x = np.array([0.0, -0.0, 1e-300, -1e-300, 5e-324, 0.625, -0.625, 20.0])
    np.testing.assert_allclose(KERNELS[which](x)[0], EXACT[which](x), rtol=4e-16, atol=1e-15)


def test_nearest_whole_numbers():
    x = np.array([0.5, 1.5, -0.5, -2.5, 2.4999999999, 1e9 + 0.5, -7.0, 0.0])
    expected = [float(round(Fraction(value))) for value in x]
    np.testing.assert_array_equal(rounded(x), expected)
