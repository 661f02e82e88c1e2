"""From an experiment to its trainings."""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Any

from kinarm import SEMANTICS
from kinarm._fields import from_plain, init_fields, to_plain
from kinarm.errors import InvalidInputError, KinarmError, UnknownNameError
from kinarm.evaluation.experiments.curve import TrialSettings
from kinarm.evaluation.experiments.experiment import MOST_TRAININGS, Entry, Experiment
from kinarm.policies.config import TrainingConfig, merged
from kinarm.policies.learners import Learner, find_learner
from kinarm.policies.recipes import recipe
from kinarm.problem import ReachProblem

CHOSEN = {"seed", "recipe"}
"""Settings that the experiment chooses."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """One training of an experiment.

    Attributes
    ----------
    learner : str
        Name of the learner.
    config, plain : TrainingConfig and mapping
        Its settings, the arm of the problem pinned; the same as in JSON.
    trials : TrialSettings
        Which trials its policies face.
    choices, entry : mapping and Entry
        What varies in the experiment, by field; what it belongs to.
    """

    learner: str
    config: TrainingConfig
    trials: TrialSettings
    choices: Mapping[str, Any] = field(default_factory=dict)
    entry: Entry = field(default_factory=Entry)
    plain: Mapping[str, Any] | None = None

    @cached_property
    def settings(self) -> dict[str, Any]:
        """Everything that its results depend on, as in JSON."""
        return {
            "learner": self.learner,
            "config": to_plain(self.config) if self.plain is None else self.plain,
            "trials": to_plain(self.trials),
            "semantics": SEMANTICS,
        }

    @cached_property
    def key(self) -> str:
        """Hash of the settings, which names its files."""
        return hash_of(self.settings)

    @property
    def name(self) -> str:
        """Its name in a line."""
        config = self.config
        made = f"{self.learner} {config.recipe} {config.problem.name} seed {config.seed}"
        chosen = ", ".join(f"{key} {value}" for key, value in self.choices.items())
        return f"{made}, {chosen}" if chosen else made


def hash_of(entries: Any) -> str:
    """Hash of what JSON can hold."""
    return hashlib.sha256(json.dumps(entries, sort_keys=True).encode()).hexdigest()[:20]


def plan(
    experiment: Experiment, choices: Sequence[Mapping[str, Any]] | None = None
) -> tuple[Run, ...]:
    """All trainings of an experiment, seed by seed: first results cover everything.

    Raises KinarmError if a name is unknown, or a value is refused; names the field.

    Parameters
    ----------
    experiment : Experiment
        What is trained.
    choices : sequence of mappings, optional
        Values that vary, by field; those of the experiment by default.
    """
    learners = [find_learner(entry.learner) for entry in experiment.all_entries]
    _check_fields((*experiment.fixed, *experiment.grid, *experiment.searched), learners)
    varied = list(_combinations(experiment.grid)) if choices is None else choices
    each = [
        (entry, config, to_plain(config), chosen, entry.seeds or experiment.seeds)
        for entry in experiment.all_entries
        for config, chosen in _settings(experiment, entry, varied)
    ]
    if (total := sum(seeds for *_, seeds in each)) > MOST_TRAININGS:
        raise InvalidInputError(
            f"an experiment has at most {MOST_TRAININGS:,} trainings, this one {total:,}"
        )
    found: dict[tuple[str, str], Run] = {}
    for number in range(max((seeds for *_, seeds in each), default=0)):
        for entry, config, plain, chosen, seeds in each:
            if number < seeds:
                first = experiment.first_seed if entry.first_seed is None else entry.first_seed
                run = Run(
                    learner=entry.learner,
                    config=replace(config, seed=first + number),
                    trials=experiment.trials,
                    choices=chosen,
                    entry=entry,
                    plain={**plain, "seed": first + number},
                )
                found.setdefault((entry.name, run.key), run)
    return tuple(found.values())


def _combinations(grid: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Every combination of the values in lists, by field."""
    for values in product(*grid.values()):
        yield dict(zip(grid, values, strict=True))


def _settings(
    experiment: Experiment, entry: Entry, varied: Sequence[Mapping[str, Any]]
) -> Iterator[tuple[TrainingConfig, dict[str, Any]]]:
    """Settings of an entry on all of its problems, and what varies."""
    learner = find_learner(entry.learner)
    _check_fields((*entry.fixed, *entry.grid), [learner])
    fixed = {**_concerning(experiment.fixed, learner), **entry.fixed}
    distinct = {}
    for shared, own in product(varied, _combinations(entry.grid)):
        choices = {**_concerning(shared, learner), **own}
        choices = {key: value for key, value in choices.items() if key not in entry.fixed}
        distinct[repr(sorted(choices.items()))] = choices
    for problem in map(ReachProblem.load, entry.problems or experiment.problems):
        for choices in distinct.values():
            yield _config(entry, problem, {**fixed, **choices}), choices


def _concerning(entries: Mapping[str, Any], learner: Learner[Any, Any]) -> dict[str, Any]:
    """Entries of fields that a learner has."""
    known = _fields(learner)
    return {key: value for key, value in entries.items() if key.partition(".")[0] in known}


def _check_fields(keys: Iterable[str], learners: Sequence[Learner[Any, Any]]) -> None:
    """Refuse a field that none of the learners has."""
    known = dict.fromkeys(name for learner in learners for name in _fields(learner))
    for key in keys:
        if key.partition(".")[0] not in known:
            raise UnknownNameError("field of a recipe or problem", key, known)


def _fields(learner: Learner[Any, Any]) -> list[str]:
    """Fields of a learner's settings, but those that the experiment chooses."""
    return [name for name in init_fields(learner.config) if name not in CHOSEN]


def _config(entry: Entry, problem: ReachProblem, entries: Mapping[str, Any]) -> TrainingConfig:
    """A recipe for a problem, with some fields of both changed."""
    of_recipe: dict[str, Any] = {}
    for key, value in entries.items():
        part, _, path = key.partition(".")
        if part == "problem":
            try:
                problem = _changed_problem(problem, path, value)
            except KinarmError as error:
                raise InvalidInputError(f"{key}: {error}") from error
        else:
            of_recipe = merged(of_recipe, _put({}, key, value))
    config: TrainingConfig = recipe(
        entry.learner, entry.recipe or None, problem=problem.pinned, **of_recipe
    )
    return config


def _put(table: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    """Copy nested tables, with a value in them."""
    name, _, rest = path.partition(".")
    if rest:
        inner = table.get(name, {})
        if not isinstance(inner, dict):
            raise InvalidInputError(f"{name!r} of {path!r} is no table")
        value = _put(inner, rest, value)
    return {**table, name: value}


def _changed_problem(problem: ReachProblem, path: str, value: Any) -> ReachProblem:
    """A problem with another value of one field, as in a problem file.

    Its path is such as ``"task.start_spread"`` or ``"scene"``. Raises KinarmError if there is no
    such field, or it cannot have the value.
    """
    if "." not in path:
        return problem.replace(**{path: value})
    entries = _put(problem.to_json(), path, value)
    if path.startswith("arm."):
        entries["arm"].pop("digest", None)
    return from_plain(ReachProblem, entries, "problem")
