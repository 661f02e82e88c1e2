"""Checks of arguments that come from users: what is wrong is an `InvalidInputError`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm.errors import InvalidInputError

MOST_TRIALS = 10_000_000
"""Trials of a set at most: memory grows with them."""


def finite_array(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """Copy an argument into a contiguous float64 array, or refuse it.

    Parameters
    ----------
    name, value
        Name of the argument, for messages, and the argument.
    shape : tuple
        Shape that it has to have, in which None stands for any length.
    """
    try:
        array = np.array(value, dtype=np.float64, order="C")
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidInputError(f"{name} must be numbers: {error}") from error
    if array.shape != shape and (
        array.ndim != len(shape)
        or any(want not in (None, has) for want, has in zip(shape, array.shape, strict=True))
    ):
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
    name, value, shape
        As for `finite_array`; the shape is that of an item.
    """
    try:
        one = np.ndim(value) == len(shape)
    except ValueError:
        one = False
    if one:
        return finite_array(name, value, shape)[None], True
    return finite_array(name, value, (None, *shape)), False


def whole_number(name: str, value: object, at_least: int, at_most: float = math.inf) -> int:
    """Return a whole number that is in range, or refuse it.

    Parameters
    ----------
    name, value
        Name of the argument, for messages, and the argument.
    at_least, at_most : int
        Its range.
    """
    if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < at_least:
        raise InvalidInputError(
            f"{name} must be a whole number of at least {at_least}, got {value!r}"
        )
    if value > at_most:
        raise InvalidInputError(f"{name} must be at most {at_most}, got {value}")
    return int(value)
