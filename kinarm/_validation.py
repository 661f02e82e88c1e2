"""Checks of arguments that come from users."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm.errors import InvalidInputError

MOST_TRIALS = 10_000_000
"""Trials of a set at most: memory grows with them."""


def finite_array(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """Copy an argument into a contiguous float64 array.

    Parameters
    ----------
    name : str
        Name of the argument, for messages.
    value : array_like
        The argument.
    shape : tuple
        Shape that it has to have, in which None stands for any length.

    Raises
    ------
    InvalidInputError
        If it is not numeric, has another shape, or holds an entry that is not finite.
    """
    try:
        array = np.array(value, dtype=np.float64, order="C")
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidInputError(f"{name} must be numbers: {error}") from error
    if array.shape != shape and not _matches(array.shape, shape):
        wanted = ", ".join("n" if length is None else str(length) for length in shape)
        raise InvalidInputError(f"{name} must have shape ({wanted}), got {array.shape}")
    if not np.isfinite(array).all():
        where = np.argwhere(~np.isfinite(array))[0].tolist()
        raise InvalidInputError(f"{name} must be finite, got {array[tuple(where)]} at {where}")
    return array


def one_or_many(
    name: str, value: ArrayLike, shape: tuple[int, ...]
) -> tuple[NDArray[np.float64], bool]:
    """Copy one item of a shape, or n of them, into an array of n; and whether it was one.

    Parameters
    ----------
    name : str
        Name of the argument, for messages.
    value : array_like, shape ``shape`` or (n, *shape)
        The argument.
    shape : tuple of int
        Shape of an item.

    Raises
    ------
    InvalidInputError
        As `finite_array` does.
    """
    try:
        one = np.ndim(value) == len(shape)
    except ValueError:
        one = False
    if one:
        return finite_array(name, value, shape)[None], True
    return finite_array(name, value, (None, *shape)), False


def _matches(actual: tuple[int, ...], expected: tuple[int | None, ...]) -> bool:
    """Whether a shape is the expected one, in which None stands for any length."""
    return len(actual) == len(expected) and all(
        wanted in (None, length) for length, wanted in zip(actual, expected, strict=True)
    )


def whole_number(name: str, value: object, at_least: int, at_most: float = math.inf) -> int:
    """Return a whole number that is in range.

    Parameters
    ----------
    name : str
        Name of the argument, for messages.
    value : int
        The argument.
    at_least, at_most : int
        Its range.

    Raises
    ------
    InvalidInputError
        If it is no whole number, or out of range.
    """
    if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < at_least:
        raise InvalidInputError(
            f"{name} must be a whole number of at least {at_least}, got {value!r}"
        )
    if value > at_most:
        raise InvalidInputError(f"{name} must be at most {at_most}, got {value}")
    return int(value)
