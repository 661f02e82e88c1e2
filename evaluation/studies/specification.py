"""What a study is: a file that names learners, problems, seeds and what varies."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any

from kinarm._fields import OPTIONAL, check_fields, from_plain, read_toml, to_plain
from kinarm._validation import MOST_TRIALS, whole_number
from kinarm.errors import InvalidInputError
from kinarm.evaluation.studies.ranges import RANGE, check_range, draw
from kinarm.randomness import Stream, stream_generator

MOST_TRAININGS = 100_000
"""Trainings of a study at most: all of them are planned before the first begins."""

MOST_FACINGS = 1000
"""How often a policy faces the trials per decade of its training, at most."""

SEVERAL = ("learners", "recipes", "problems")
"""Entries of a file that are lists; a text stands for a list of one."""


@dataclass(frozen=True, kw_only=True)
class StudyTrials:
    """How the policies of a study are judged.

    Parameters
    ----------
    count : int
        Trials that every policy faces.
    seed : int
        Seed of the trials.
    per_decade : int
        How often a policy faces them in the course of its training while the environment steps
        grow tenfold; 0 for at the end alone.
    first : int
        Environment steps after which it faces them for the first time.
    """

    count: int = 1000
    seed: int = 0
    per_decade: int = 4
    first: int = 10_000

    def __post_init__(self) -> None:
        check_fields(self)
        whole_number("count", self.count, 1, MOST_TRIALS)
        whole_number("seed", self.seed, 0)
        whole_number("per_decade", self.per_decade, 0, MOST_FACINGS)
        whole_number("first", self.first, 1)


@dataclass(frozen=True, kw_only=True)
class StudySpecification:
    """The trainings of a study: every learner, recipe, problem, choice and seed with every other.

    Fields of settings are named as in a recipe (``step_size``, ``reward.success``), those of a
    problem by their path (``problem.task.start_spread``, ``problem.arm``). With the name of a
    learner in front (``ars.step_size``), they concern that learner alone.

    Parameters
    ----------
    name : str
        How page and folder call it.
    learners : tuple of str
        Names of learners.
    recipes : tuple of str
        Names or files of recipes.
    problems : tuple of str
        Names or files of problems.
    seeds : int
        Trainings with each setting.
    first_seed : int
        Seed of the first of them; the others follow.
    trials : StudyTrials
        How the policies are judged.
    fixed : dict
        Values of fields that stay.
    grid : dict
        Lists of values of fields; all combinations are trained.
    random : dict
        ``count`` combinations, drawn by ``seed`` (0), of fields with a list of values, or a table
        of ``low``, ``high`` and, to draw the logarithm evenly, ``log = true``.
    search : dict
        ``count`` combinations that Optuna proposes, by ``seed`` (0) and ``sampler`` (tpe), of
        fields as in ``random``; ``pruner`` (median) says which trainings are broken off.
    """

    name: str
    learners: tuple[str, ...] = ("ars",)
    recipes: tuple[str, ...] = ("paper",)
    problems: tuple[str, ...] = ("right",)
    seeds: int = 1
    first_seed: int = 0
    trials: StudyTrials = field(default_factory=StudyTrials)
    fixed: dict[str, Any] = field(default_factory=dict, metadata=OPTIONAL)
    grid: dict[str, Any] = field(default_factory=dict, metadata=OPTIONAL)
    random: dict[str, Any] = field(default_factory=dict, metadata=OPTIONAL)
    search: dict[str, Any] = field(default_factory=dict, metadata=OPTIONAL)

    def __post_init__(self) -> None:
        check_fields(self)
        whole_number("seeds", self.seeds, 1, MOST_TRAININGS)
        whole_number("first_seed", self.first_seed, 0)
        for name in SEVERAL:
            values = getattr(self, name)
            if not values:
                raise InvalidInputError(f"{name} must not be empty")
            if len(set(values)) < len(values):
                raise InvalidInputError(f"{name} names the same twice: {', '.join(values)}")
        tables = {
            "fixed": self.fixed,
            "grid": self.grid,
            "random": _ranges(self.random),
            "search": self.searched,
        }
        given: dict[str, str] = {}
        for table, entries in tables.items():
            for key in entries:
                if key in given:
                    raise InvalidInputError(f"{key!r} stands in {given[key]} and in {table}")
                given[key] = table
        for key, values in self.grid.items():
            if not isinstance(values, list | tuple) or not values:
                raise InvalidInputError(
                    f"grid.{key} must be a list of at least one value, got {values!r}"
                )
        for table, entries in (("random", self.random), ("search", self.search)):
            if entries:
                whole_number(f"{table}.count", entries.get("count", 0), 1, MOST_TRAININGS)
                whole_number(f"{table}.seed", entries.get("seed", 0), 0)
                for key, entry in _ranges(entries).items():
                    check_range(f"{table}.{key}", entry)
        if self.size > MOST_TRAININGS:
            raise InvalidInputError(
                f"a study has at most {MOST_TRAININGS:,} trainings, this one {self.size:,}"
            )
        self._check_search()

    @property
    def size(self) -> int:
        """Trainings that it asks for, those that turn out to be the same included."""
        several = (*(getattr(self, name) for name in SEVERAL), *self.grid.values())
        drawn = self.random.get("count", 1) * self.search.get("count", 1)
        return int(math.prod(map(len, several)) * drawn * self.seeds)

    def _check_search(self) -> None:
        """Refuse what cannot be searched."""
        if not self.search:
            return
        for table in ("grid", "random"):
            if getattr(self, table):
                raise InvalidInputError(f"search and {table} exclude each other")
        for name in ("learners", "recipes"):
            if len(getattr(self, name)) > 1:
                raise InvalidInputError(
                    f"a search has one of {name}, got {len(getattr(self, name))}"
                )
        for name, known in SEARCH_CHOICES.items():
            if self.search.get(name, known[0]) not in known:
                raise InvalidInputError(
                    f"search.{name} must be one of {', '.join(known)}, got {self.search[name]!r}"
                )
        if not self.searched:
            raise InvalidInputError("search names no field")
        for key in self.searched:
            if key.startswith("problem."):
                raise InvalidInputError(f"a search is for settings of a learner, not for {key!r}")

    @property
    def searched(self) -> dict[str, Any]:
        """What is searched, by field."""
        return _ranges(self.search)

    def choices(self) -> Iterator[dict[str, Any]]:
        """Every combination of the values that vary, by field."""
        for values in product(*self.grid.values()):
            of_grid = dict(zip(self.grid, values, strict=True))
            for drawn in self._drawn():
                yield {**of_grid, **drawn}

    def _drawn(self) -> Iterator[dict[str, Any]]:
        """Random combinations; a larger number keeps the first ones."""
        if not self.random:
            yield {}
            return
        for number in range(self.random["count"]):
            rng = stream_generator(Stream.STUDY, self.random.get("seed", 0), number)
            yield {key: draw(entry, rng.random()) for key, entry in _ranges(self.random).items()}

    def to_json(self) -> dict[str, Any]:
        """As a dictionary that TOML and JSON can hold."""
        entries: dict[str, Any] = to_plain(self)
        return entries

    @classmethod
    def from_json(cls, entries: Mapping[str, Any], where: str) -> "StudySpecification":
        """Rebuild what `to_json` returned, or what a file holds.

        Raises
        ------
        InvalidInputError
            If an entry is missing, unknown or wrong; in one line that names source, key and what
            is expected.
        """
        made = dict(entries)
        for name in SEVERAL:
            single = name.removesuffix("s")
            if single in made and name not in made:
                made[name] = made.pop(single)
            if isinstance(made.get(name), str):
                made[name] = [made[name]]
        for table in ("fixed", "grid", "random", "search"):
            if isinstance(made.get(table), Mapping):
                made[table] = dict(_flat(made[table], ranges=table in ("random", "search")))
        return from_plain(cls, made, where)

    @classmethod
    def load(cls, path: str | Path) -> "StudySpecification":
        """Read a study file; its name is that of the study unless it says otherwise.

        Paths of problems and recipes in it are relative to it.

        Raises
        ------
        InvalidInputError
            If it cannot be used; in one line that names file, key and what is expected.
        """
        file = Path(path)
        entries = {"name": file.stem, **read_toml(file, "study")}
        made = cls.from_json(entries, str(file))
        return made.resolved(file.parent)

    def resolved(self, folder: Path) -> "StudySpecification":
        """The same study, with its files found from wherever it is read."""

        def found(name: str) -> str:
            beside = folder / name
            return str(beside.resolve()) if name.endswith(".toml") and beside.is_file() else name

        return replace(
            self,
            recipes=tuple(map(found, self.recipes)),
            problems=tuple(map(found, self.problems)),
        )


SEARCH_CHOICES = {"sampler": ("tpe", "random", "cmaes"), "pruner": ("median", "none", "hyperband")}
"""What can be said of a search beside count and seed; the first is the default."""


def _ranges(entries: Mapping[str, Any]) -> dict[str, Any]:
    """What is drawn or searched, by field."""
    said = ("count", "seed", *SEARCH_CHOICES)
    return {key: entry for key, entry in entries.items() if key not in said}


def _flat(entries: Mapping[str, Any], *, ranges: bool, path: str = "") -> Iterator[tuple[str, Any]]:
    """Entries of tables within tables by their paths; tables that are ranges stay whole."""
    for key, entry in entries.items():
        is_range = ranges and isinstance(entry, Mapping) and set(entry) & set(RANGE)
        if isinstance(entry, Mapping) and not is_range:
            yield from _flat(entry, ranges=ranges, path=f"{path}{key}.")
        else:
            yield f"{path}{key}", entry
