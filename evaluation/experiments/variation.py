"""What varies in an experiment: fields by their paths, with lists of values or ranges."""

from collections.abc import Iterable, Iterator, Mapping
from itertools import product
from typing import Any, TypeGuard

import numpy as np

from kinarm.errors import InvalidInputError

DIGITS = 6
"""Significant digits of numbers that are drawn: more could differ between machines."""

RANGE = ("low", "high", "log")

LARGEST = 1e30
"""Size of low and high at most, and of 1 / low with log: what is drawn does not overflow."""


def check_range(where: str, entry: Any) -> None:
    """Refuse what nothing can be drawn from."""
    if isinstance(entry, list | tuple):
        if not entry:
            raise InvalidInputError(f"{where} must be a list of at least one value, got {entry!r}")
        return
    given = entry if isinstance(entry, Mapping) else {}
    low, high = given.get("low"), given.get("high")
    if not (_is_number(low) and _is_number(high) and low < high) or set(given) - set(RANGE):
        raise InvalidInputError(
            f"{where} must be a list of values, or a table with low below high and perhaps log, "
            f"got {entry!r}"
        )
    if given.get("log") and low <= 0:
        raise InvalidInputError(f"{where}.low must be greater than 0 with log, got {low!r}")
    least = 1 / LARGEST if given.get("log") else -LARGEST
    for end, value in (("low", low), ("high", high)):
        if not least <= value <= LARGEST:
            raise InvalidInputError(
                f"{where}.{end} must be between {least:g} and {LARGEST:g}, got {value!r}"
            )


def _is_number(value: Any) -> TypeGuard[float]:
    """Whether a value is a number; a truth value is none."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def draw(entry: Any, uniform: float) -> Any:
    """What a number from [0, 1) chooses of a list or a range; whole between whole numbers."""
    if isinstance(entry, list | tuple):
        return entry[int(uniform * len(entry))]
    low, high = entry["low"], entry["high"]
    whole = isinstance(low, int) and isinstance(high, int)
    if entry.get("log"):
        value = float(low * np.exp(uniform * np.log(high / low)))
    else:
        value = low + uniform * (high - low + whole)
    if whole:
        return min(int(value), high)
    return float(f"{value:.{DIGITS}g}")


def combinations(grid: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Every combination of the values in lists, by field."""
    for values in product(*grid.values()):
        yield dict(zip(grid, values, strict=True))


def check_grid(grid: Mapping[str, Any]) -> None:
    """Refuse lists of values that are none."""
    for key, values in grid.items():
        if not isinstance(values, list | tuple) or not values:
            raise InvalidInputError(
                f"grid.{key} must be a list of at least one value, got {values!r}"
            )


def flattened(
    entries: Mapping[str, Any], *, ranges: bool, path: str = ""
) -> Iterator[tuple[str, Any]]:
    """Entries of tables within tables by their paths.

    Parameters
    ----------
    entries : mapping
        The tables.
    ranges : bool
        Whether tables that are ranges stay whole.
    path : str
        What all paths begin with.
    """
    for key, entry in entries.items():
        is_range = ranges and isinstance(entry, Mapping) and set(entry) & set(RANGE)
        if isinstance(entry, Mapping) and not is_range:
            yield from flattened(entry, ranges=ranges, path=f"{path}{key}.")
        else:
            yield f"{path}{key}", entry


SEARCH_CHOICES = {"sampler": ("tpe", "random", "cmaes"), "pruner": ("median", "none", "hyperband")}
"""What can be said of a search beside count and seed; the first is the default."""


TABLES = ("fixed", "grid", "random", "search")
"""Entries of a file that name fields of settings."""


def ranges_of(entries: Mapping[str, Any]) -> dict[str, Any]:
    """What is drawn or searched, by field."""
    said = ("count", "seed", *SEARCH_CHOICES)
    return {key: entry for key, entry in entries.items() if key not in said}


def prepared(entries: Mapping[str, Any], several: Iterable[str]) -> dict[str, Any]:
    """Entries of a file, with lists for texts, and with paths for tables within tables."""
    made = dict(entries)
    for name in several:
        single = name.removesuffix("s")
        if single in made and name not in made:
            made[name] = made.pop(single)
        if isinstance(made.get(name), str):
            made[name] = [made[name]]
    for table in TABLES:
        if isinstance(made.get(table), Mapping):
            made[table] = dict(flattened(made[table], ranges=table in ("random", "search")))
    return made
