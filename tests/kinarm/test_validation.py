"""Arrays that come from users."""

import numpy as np
import pytest

from kinarm.errors import InvalidInputError, finite_array, one_or_many


def test_gives_a_contiguous_float_copy():
    given = np.asfortranarray(np.arange(6).reshape(2, 3))
    array = finite_array("x", given, (2, 3))
    assert array.dtype == np.float64
    assert array.flags.c_contiguous
    np.testing.assert_array_equal(array, given)
    array[0, 0] = 9
    assert given[0, 0] == 0


def test_none_stands_for_any_length():
    assert finite_array("x", [[1, 2]] * 7, (None, 2)).shape == (7, 2)
    assert finite_array("x", np.zeros((0, 2)), (None, 2)).shape == (0, 2)


@pytest.mark.parametrize(
    ("value", "shape"), [([1, 2], (3,)), ([[1, 2]], (2,)), (1.0, (1,)), ([[1, 2]], (None, 3))]
)
def test_wrong_shape_says_both_shapes(value, shape):
    wanted = ", ".join("n" if length is None else str(length) for length in shape)
    with pytest.raises(InvalidInputError) as caught:
        finite_array("speed", value, shape)
    assert f"speed must have shape ({wanted}" in str(caught.value)
    assert f"got {np.shape(value)}" in str(caught.value)


def test_not_finite_says_where():
    with pytest.raises(InvalidInputError, match=r"x must be finite, got nan at \[1, 0\]"):
        finite_array("x", [[0, 0], [np.nan, 0]], (2, 2))


def test_one_or_many():
    for given in ([1, 2, 3], [[1, 2, 3]]):
        array, one = one_or_many("x", given, (3,))
        np.testing.assert_array_equal(array, [[1, 2, 3]])
        assert one == (np.ndim(given) == 1)
    assert one_or_many("x", np.zeros((5, 4, 4)), (4, 4))[0].shape == (5, 4, 4)
    for given in ([1, 2], [[1, 2]], [[1, 2, 3], [1, 2]], 1.0, "here"):
        with pytest.raises(InvalidInputError, match="x must"):
            one_or_many("x", given, (3,))
