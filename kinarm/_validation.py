"""Checks of arguments that come from users: what is wrong is an `InvalidInputError`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm.errors import InvalidInputError

MOST_TRIALS = 10_000_000
"""Trials of a set at most: memory grows with them."""

FROM_ZERO: Mapping[str, Any] = {"at_least": 0}
TRIALS: Mapping[str, Any] = {"at_most": MOST_TRIALS}
POSITIVE = {"must": "be greater than 0", "holds": lambda value: value > 0}
NOT_NEGATIVE = {"must": "not be negative", "holds": lambda value: value >= 0}
SHARE = {"must": "lie in [0, 1]", "holds": lambda value: 0 <= value <= 1}
"""Ranges of numbers: metadata of fields."""

LARGEST = 1e6
"""Numbers of settings at most [m or any unit]; parameters would overflow with larger ones."""


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


def check_range(name: str, value: Any, demands: Mapping[str, Any]) -> None:
    """Refuse numbers that are not finite or break what the metadata of their field demand.

    Parameters
    ----------
    name : str
        Name of the field, for messages.
    value : object
        Its value, in its unit; entries of tuples are looked at one by one, and what is no number
        passes.
    demands : mapping
        Metadata of the field. For whole numbers: ``at_least``, 1 if it is not said, and
        ``at_most``. For other numbers: a condition that ``holds``, and what they ``must`` in words.
    """
    if isinstance(value, tuple):
        for each in value:
            check_range(name, each, demands)
    elif type(value) is int:
        whole_number(name, value, demands.get("at_least", 1), demands.get("at_most", math.inf))
    elif isinstance(value, float):
        must, holds = demands.get("must", "be finite"), demands.get("holds", math.isfinite)
        if not (math.isfinite(value) and holds(value)):
            raise InvalidInputError(f"{name} must {must}, got {value}")
        if abs(value) > LARGEST:
            raise InvalidInputError(f"{name} must be at most {LARGEST:g}, got {value}")
