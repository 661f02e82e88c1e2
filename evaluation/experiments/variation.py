"""Variation in an experiment: fields by their paths, with lists of values or ranges."""

from collections.abc import Iterable, Iterator, Mapping
from itertools import product
from typing import Any

import numpy as np

from kinarm.errors import InvalidInputError

DIGITS = 6
"""Significant digits of numbers that are drawn: more could differ between machines."""

RANGE = ("low", "high", "log")

TABLES = ("fixed", "grid", "random", "search")
"""Entries of a file that name fields of settings."""

SEARCH_CHOICES = {
    "sampler": {"tpe": "TPESampler", "random": "RandomSampler", "cmaes": "CmaEsSampler"},
    "pruner": {"median": "MedianPruner", "none": "NopPruner", "hyperband": "HyperbandPruner"},
}
"""Choices of a search beside count and seed, and Optuna's names of them; the first of each is the
default."""


def check_tables(**tables: Mapping[str, Any]) -> None:
    """Refuse fields that stand in two tables, and values that nothing can be made of."""
    given: dict[str, str] = {}
    for table, entries in tables.items():
        for key, entry in entries.items():
            if key in given:
                raise InvalidInputError(f"{key!r} stands in {given[key]} and in {table}")
            given[key] = table
            if table != "fixed":
                _check_values(f"{table}.{key}", entry, ranges=table != "grid")


def _check_values(where: str, entry: Any, *, ranges: bool) -> None:
    """Refuse what is neither a list of values nor, where there may be one, a range."""
    if isinstance(entry, list | tuple) or not ranges:
        if not isinstance(entry, list | tuple) or not entry:
            raise InvalidInputError(f"{where} must be a list of at least one value, got {entry!r}")
        return
    given = entry if isinstance(entry, Mapping) else {}
    low: Any = given.get("low")
    high: Any = given.get("high")
    numbers = {type(low), type(high)} <= {int, float} and not set(given) - set(RANGE)
    if not (numbers and low < high and (low > 0 or not given.get("log"))):
        raise InvalidInputError(
            f"{where} must be a list of values, or a table with low below high and perhaps "
            f"log = true, with which low is above 0, got {entry!r}"
        )


def draw(entry: Any, uniform: float) -> Any:
    """Value of a list or a range that a number from [0, 1) chooses; whole between whole numbers."""
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


def ranges_of(entries: Mapping[str, Any]) -> dict[str, Any]:
    """Lists and ranges that are drawn or searched, by field."""
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
            made[table] = dict(_flattened(made[table], table in ("random", "search")))
    return made


def _flattened(
    entries: Mapping[str, Any], ranges: bool, path: str = ""
) -> Iterator[tuple[str, Any]]:
    """Entries of tables within tables by their paths; tables that are ranges may stay whole."""
    for key, entry in entries.items():
        if isinstance(entry, Mapping) and not (ranges and set(entry) & set(RANGE)):
            yield from _flattened(entry, ranges, f"{path}{key}.")
        else:
            yield f"{path}{key}", entry
