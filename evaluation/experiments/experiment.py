"""An experiment: a file of learners, problems, seeds and what varies."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any

from kinarm._fields import OPTIONAL, Checked, from_plain, read_toml, to_plain
from kinarm._files import named_file
from kinarm.errors import FROM_ZERO, InvalidInputError, check_known, whole_number
from kinarm.evaluation.experiments.curve import TrialSettings

MOST_TRAININGS = 100_000
TRAININGS = {"at_most": MOST_TRAININGS}
"""Most trainings of an experiment: all are planned before the first begins."""

SEVERAL = ("learners", "recipes", "problems")
"""Entries of a file that are lists; a text is a list of one."""

RANGE = ("low", "high", "log")

TABLES = ("fixed", "grid", "search")
"""Entries of a file that name fields of settings."""

SAMPLERS = {"tpe": "TPESampler", "random": "RandomSampler", "cmaes": "CmaEsSampler"}
"""Samplers of a search and Optuna's names of them, the default first."""


@dataclass(frozen=True, kw_only=True)
class Entry(Checked):
    """A learner with a recipe and settings of its own.

    Parameters
    ----------
    name : str
        Unique in the experiment; learner and recipe by default.
    title : str
        Name in tables and figures; what sets it apart by default.
    source : str
        Where its settings come from.
    learner : str
        Name of the learner.
    recipe : str
        Name or file of the recipe; the first of the learner by default.
    problems : tuple of str
        Names or files of problems; those of the experiment by default.
    seeds, first_seed : int, optional
        Trainings with each setting, and the first seed; those of the experiment
        by default.
    fixed, grid : dict
        Fixed values of fields, and lists of values, added to those of the
        experiment, or in their place.
    """

    name: str = field(default="", metadata=OPTIONAL)
    title: str = field(default="", metadata=OPTIONAL)
    source: str = field(default="", metadata=OPTIONAL)
    learner: str = "ars"
    recipe: str = field(default="", metadata=OPTIONAL)
    problems: tuple[str, ...] = field(default=(), metadata=OPTIONAL)
    seeds: int = field(default=0, metadata={**FROM_ZERO, **TRAININGS, **OPTIONAL})
    first_seed: int | None = field(default=None, metadata=FROM_ZERO)
    fixed: dict[str, Any] = field(default_factory=dict, metadata=OPTIONAL)
    grid: dict[str, Any] = field(default_factory=dict, metadata=OPTIONAL)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.name:
            recipe = Path(self.recipe).stem if self.recipe.endswith(".toml") else self.recipe
            name = f"{self.learner}-{recipe}" if recipe else self.learner
            object.__setattr__(self, "name", name)
        _check_tables(fixed=self.fixed, grid=self.grid)


@dataclass(frozen=True, kw_only=True)
class Experiment(Checked):
    """A set of trainings: all combinations of entries, problems, choices and seeds.

    Fields are named as in a recipe (``step_size``, ``reward.success``), those
    of a problem by path (``problem.task.start_spread``, ``problem.arm``). They
    concern the learners that have them.

    Parameters
    ----------
    name : str
        Name of page and folder.
    learners, recipes : tuple of str
        Names of learners; names or files of recipes, the first of each learner
        by default.
    entries : tuple of Entry
        Used instead of all learners with all recipes.
    problems : tuple of str
        Names or files of problems.
    seeds, first_seed : int
        Trainings with each setting, and the first seed.
    trials : TrialSettings
        Which trials the policies face.
    bounds : bool
        Whether to find what any policy could reach in the trials.
    fixed, grid : dict
        Fixed values of fields, and lists of values, of which all combinations
        are trained.
    search : dict
        ``count`` combinations that Optuna proposes, by ``seed`` (0) and
        ``sampler`` (tpe), of fields with a list of values, or a table of
        ``low``, ``high`` and, for an even logarithm, ``log = true``.
    """

    name: str
    learners: tuple[str, ...] = ("ars",)
    recipes: tuple[str, ...] = field(default=(), metadata=OPTIONAL)
    problems: tuple[str, ...] = ("right",)
    seeds: int = field(default=1, metadata=TRAININGS)
    first_seed: int = field(default=0, metadata=FROM_ZERO)
    trials: TrialSettings = field(default_factory=TrialSettings)
    bounds: bool = field(default=True, metadata=OPTIONAL)
    fixed: dict[str, Any] = field(default_factory=dict, metadata=OPTIONAL)
    grid: dict[str, Any] = field(default_factory=dict, metadata=OPTIONAL)
    search: dict[str, Any] = field(default_factory=dict, metadata=OPTIONAL)
    entries: tuple[Entry, ...] = field(default=(), metadata=OPTIONAL)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in SEVERAL:
            if not getattr(self, name) and name != "recipes":
                raise InvalidInputError(f"{name} must not be empty")
            _check_distinct(name, getattr(self, name))
        _check_distinct("entries", [entry.name for entry in self.entries])
        _check_tables(fixed=self.fixed, grid=self.grid, search=self.searched)
        if self.search:
            whole_number("search.count", self.search.get("count", 0), 1, MOST_TRAININGS)
            whole_number("search.seed", self.search.get("seed", 0), 0)
            self._check_search()

    def _check_search(self) -> None:
        """Refuse what cannot be searched."""
        if self.grid:
            raise InvalidInputError("search and grid exclude each other")
        if len(self.all_entries) > 1:
            raise InvalidInputError(
                f"a search has one learner and one recipe, got {len(self.all_entries)} of both"
            )
        if self.sampler not in SAMPLERS:
            raise InvalidInputError(
                f"search.sampler must be one of {', '.join(SAMPLERS)}, got {self.sampler!r}"
            )
        if not self.searched:
            raise InvalidInputError("search names no field")
        for key in self.searched:
            if key.startswith("problem."):
                raise InvalidInputError(f"a search is for settings of a learner, not for {key!r}")

    @property
    def all_entries(self) -> tuple[Entry, ...]:
        """The entries given, or all learners with all recipes."""
        return self.entries or tuple(
            Entry(learner=learner, recipe=recipe)
            for learner, recipe in product(self.learners, self.recipes or ("",))
        )

    @property
    def sampler(self) -> Any:
        """Who proposes settings of a search, by name."""
        return self.search.get("sampler", next(iter(SAMPLERS)))

    @property
    def searched(self) -> dict[str, Any]:
        """Lists and ranges that are searched, by field."""
        said = ("count", "seed", "sampler")
        return {key: entry for key, entry in self.search.items() if key not in said}

    def to_json(self) -> dict[str, Any]:
        """As a dictionary that TOML and JSON can hold."""
        entries: dict[str, Any] = to_plain(self)
        return entries

    @classmethod
    def from_json(cls, entries: Mapping[str, Any], where: str) -> "Experiment":
        """Rebuild what `to_json` returned, or what the file ``where`` holds.

        Raises
        ------
        InvalidInputError
            If an entry is missing, unknown or wrong; names source, key and what
            is expected.
        """
        made = _prepared(entries, SEVERAL)
        if isinstance(made.get("entries"), list):
            made["entries"] = [
                _prepared(each, ("problems",)) if isinstance(each, Mapping) else each
                for each in made["entries"]
            ]
        return from_plain(cls, made, where)

    @classmethod
    def load(cls, name_or_file: str | Path) -> "Experiment":
        """Read a file, or a shipped experiment by its name.

        By default it is named after its file. Paths are relative to the file.

        Raises
        ------
        InvalidInputError
            If it cannot be used; names file, key and what is expected.
        """
        file = named_file("experiment", name_or_file)
        entries = {"name": file.stem, **read_toml(file, "experiment")}
        return cls.from_json(entries, str(file)).resolved(file.parent)

    def only(
        self,
        *,
        entries: Iterable[str] = (),
        problems: Sequence[str] = (),
        seeds: int | None = None,
    ) -> "Experiment":
        """A part of the experiment, or with other problems or seeds.

        Parameters
        ----------
        entries, problems : iterable of str
            Names of entries, all by default; names or files of problems, its
            own by default.
        seeds : int, optional
            Trainings with each setting.
        """
        known = {entry.name: entry for entry in self.all_entries}
        check_known("entry", entries, known)
        chosen = tuple(known[name] for name in dict.fromkeys(entries)) or self.entries
        if problems:
            chosen = tuple(replace(entry, problems=()) for entry in chosen)
        if seeds is not None:
            chosen = tuple(replace(entry, seeds=0) for entry in chosen)
        return replace(
            self,
            entries=chosen,
            problems=tuple(problems) or self.problems,
            seeds=self.seeds if seeds is None else seeds,
        )

    def resolved(self, folder: Path) -> "Experiment":
        """The experiment with absolute paths for files in a folder."""

        def found(name: str) -> str:
            beside = folder / name
            return str(beside.resolve()) if name.endswith(".toml") and beside.is_file() else name

        entries = tuple(
            replace(each, recipe=found(each.recipe), problems=tuple(map(found, each.problems)))
            for each in self.entries
        )
        recipes, problems = tuple(map(found, self.recipes)), tuple(map(found, self.problems))
        return replace(self, recipes=recipes, problems=problems, entries=entries)


def _check_distinct(name: str, values: Sequence[str]) -> None:
    if len(set(values)) < len(values):
        raise InvalidInputError(f"{name} names the same twice: {', '.join(values)}")


def _check_tables(**tables: Mapping[str, Any]) -> None:
    """Refuse fields in two tables, and wrong values."""
    given: dict[str, str] = {}
    for table, entries in tables.items():
        for key, entry in entries.items():
            if key in given:
                raise InvalidInputError(f"{key!r} stands in {given[key]} and in {table}")
            given[key] = table
            if table != "fixed":
                _check_values(f"{table}.{key}", entry, ranges=table != "grid")


def _check_values(where: str, entry: Any, *, ranges: bool) -> None:
    """Refuse what is neither a list nor, where allowed, a range."""
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


def _prepared(entries: Mapping[str, Any], several: Iterable[str]) -> dict[str, Any]:
    """Entries of a file, with lists for texts, and nested tables flattened."""
    made = dict(entries)
    for name in several:
        single = name.removesuffix("s")
        if single in made and name not in made:
            made[name] = made.pop(single)
        if isinstance(made.get(name), str):
            made[name] = [made[name]]
    for table in TABLES:
        if isinstance(made.get(table), Mapping):
            made[table] = dict(_flattened(made[table], table == "search"))
    return made


def _flattened(
    entries: Mapping[str, Any], ranges: bool, path: str = ""
) -> Iterator[tuple[str, Any]]:
    """Entries of nested tables by path; ranges may stay whole."""
    for key, entry in entries.items():
        if isinstance(entry, Mapping) and not (ranges and set(entry) & set(RANGE)):
            yield from _flattened(entry, ranges, f"{path}{key}.")
        else:
            yield f"{path}{key}", entry
