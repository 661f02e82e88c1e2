"""Checks of arguments that come from users."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm.errors import InvalidInputError


def finite_array(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """Copy an argument into a contiguous float64 array.

    Raises
    ------
    InvalidInputError
        If it is not numeric, has another shape, in which None stands for any length, or holds an
        entry that is not finite.
    """
    try:
        array = np.array(value, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"{name} must be numbers: {error}") from error
    matches = array.ndim == len(shape) and all(
        expected in (None, actual) for actual, expected in zip(array.shape, shape, strict=True)
    )
    if not matches:
        wanted = ", ".join("n" if length is None else str(length) for length in shape)
        raise InvalidInputError(f"{name} must have shape ({wanted}), got {array.shape}")
    if not np.isfinite(array).all():
        where = np.argwhere(~np.isfinite(array))[0].tolist()
        raise InvalidInputError(f"{name} must be finite, got {array[tuple(where)]} at {where}")
    return array


def whole_number(name: str, value: object, at_least: int) -> int:
    """Return a whole number that is large enough, or raise InvalidInputError."""
    if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < at_least:
        raise InvalidInputError(
            f"{name} must be a whole number of at least {at_least}, got {value!r}"
        )
    return int(value)
