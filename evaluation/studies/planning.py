"""From a study to its trainings."""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, is_dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

from kinarm import SEMANTICS
from kinarm._fields import alternatives, field_types, from_plain, init_fields, to_plain
from kinarm.errors import InvalidInputError, KinarmError, UnknownNameError
from kinarm.evaluation.studies.specification import StudySpecification, StudyTrials
from kinarm.policies.config import TrainingConfig
from kinarm.policies.learners import find_learner, learner_of
from kinarm.policies.recipes import recipe
from kinarm.problem import ReachProblem

PROBLEM = "problem."
"""What the path of a field of the problem begins with."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedRun:
    """One training of a study.

    Attributes
    ----------
    config : TrainingConfig
        All of its settings; the arm of the problem is pinned.
    trials : StudyTrials
        How it is judged.
    choices : mapping
        What of it varies in the study, by field.
    entries : mapping, optional
        The settings as JSON holds them, where they are known already.
    """

    config: TrainingConfig
    trials: StudyTrials
    choices: Mapping[str, Any]
    entries: Mapping[str, Any] | None = None

    @property
    def learner(self) -> str:
        """Name of the learner."""
        return learner_of(self.config).name

    @cached_property
    def settings(self) -> dict[str, Any]:
        """Everything that its results depend on, as JSON holds it."""
        return {
            "learner": self.learner,
            "config": to_plain(self.config) if self.entries is None else self.entries,
            "trials": to_plain(self.trials),
            "semantics": SEMANTICS,
        }

    @cached_property
    def key(self) -> str:
        """Hash of the settings; the name of its files."""
        return _hash(self.settings)

    @cached_property
    def lineage(self) -> str:
        """Hash of the settings but for the number of iterations."""
        config = {k: v for k, v in self.settings["config"].items() if k != "iterations"}
        return _hash({**self.settings, "config": config})

    @property
    def name(self) -> str:
        """What to call it in a line."""
        config = self.config
        made = f"{self.learner} {config.recipe} {config.problem.name} seed {config.seed}"
        chosen = ", ".join(f"{key} {value}" for key, value in self.choices.items())
        return f"{made}, {chosen}" if chosen else made

    @property
    def cost(self) -> float:
        """Rough duration relative to other trainings [s of a core]."""
        return self.config.cost


def _hash(entries: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(entries, sort_keys=True).encode()).hexdigest()[:20]


def planned_runs(
    study: StudySpecification, choices: Sequence[Mapping[str, Any]] | None = None
) -> tuple[PlannedRun, ...]:
    """All trainings of a study, seed by seed, so that the first results cover everything.

    Parameters
    ----------
    study : StudySpecification
        The study.
    choices : sequence of mappings, optional
        Values of what varies, by field; those of the study by default.

    Raises
    ------
    KinarmError
        If a name is unknown, a value has the wrong type or is refused; in one line that names the
        field.
    """
    _check_fields_known(study)
    varied = list(study.choices()) if choices is None else choices
    each = [
        setting
        for learner, name, problem in product(study.learners, study.recipes, study.problems)
        for setting in _settings(study, learner, name, problem, varied)
    ]
    seeds = range(study.first_seed, study.first_seed + study.seeds)
    plain = [to_plain(config) for config, _ in each]
    planned = (
        PlannedRun(
            config=replace(config, seed=seed),
            trials=study.trials,
            choices=choices,
            entries={**entries, "seed": seed},
        )
        for seed in seeds
        for (config, choices), entries in zip(each, plain, strict=True)
    )
    return tuple({run.key: run for run in planned}.values())


def _check_fields_known(study: StudySpecification) -> None:
    """Refuse a field that none of the learners has."""
    learners = {name: find_learner(name) for name in study.learners}
    available = [name for each in learners.values() for name in init_fields(each.config)]
    for key in {**study.fixed, **next(study.choices()), **study.searched}:
        owner, _, rest = key.partition(".")
        if owner in learners:
            fields, name = tuple(init_fields(learners[owner].config)), rest.partition(".")[0]
        else:
            fields, name = tuple(dict.fromkeys(available)), owner
        if name not in fields or name in ("seed", "recipe"):
            known = [*(each for each in fields if each not in ("seed", "recipe"))]
            raise UnknownNameError("field of a recipe or problem", key, known)


def _settings(
    study: StudySpecification,
    learner: str,
    name: str,
    problem: str,
    varied: Sequence[Mapping[str, Any]],
) -> Iterator[tuple[TrainingConfig, dict[str, Any]]]:
    """Settings of a learner with a recipe on a problem, and what of them varies."""
    found = ReachProblem.load(problem)
    fixed = _concerning(study.fixed, learner, study.learners)
    seen = set()
    for choice in varied:
        choices = _concerning(choice, learner, study.learners)
        if (key := repr(sorted(choices.items()))) not in seen:
            seen.add(key)
            yield _config(learner, name, found, {**fixed, **choices}), choices


def _concerning(
    entries: Mapping[str, Any], learner: str, learners: tuple[str, ...]
) -> dict[str, Any]:
    """Entries that concern a learner, without its name."""
    owned = {}
    for key, value in entries.items():
        owner, _, rest = key.partition(".")
        if owner == learner:
            owned[rest] = value
        elif owner not in learners and not _is_of_others(key, learner):
            owned[key] = value
    return owned


def _is_of_others(key: str, learner: str) -> bool:
    """Whether a learner has no such field, so that it concerns the other learners."""
    return key.partition(".")[0] not in init_fields(find_learner(learner).config)


def _config(
    learner: str, name: str, problem: ReachProblem, entries: Mapping[str, Any]
) -> TrainingConfig:
    """A recipe for a problem, with some fields of both changed."""
    of_recipe: dict[str, Any] = {}
    for key, value in entries.items():
        if key.startswith(PROBLEM):
            with _naming(key):
                problem = changed_problem(problem, key.removeprefix(PROBLEM), value)
        elif "." in key:
            outer, _, inner = key.partition(".")
            of_recipe.setdefault(outer, {})[inner] = value
        else:
            of_recipe[key] = value
    config: TrainingConfig = recipe(learner, name, problem=problem.pinned, **of_recipe)
    return config


@contextmanager
def _naming(key: str) -> Iterator[None]:
    """Say in an error which field of the study it is about."""
    try:
        yield
    except KinarmError as error:
        raise InvalidInputError(f"{key}: {error}") from error


def changed_problem(problem: ReachProblem, path: str, value: Any) -> ReachProblem:
    """A problem with another value of one field.

    Parameters
    ----------
    problem : ReachProblem
        The problem.
    path : str
        Names of the fields that lead there: ``"task.start_spread"``, ``"scene"``.
    value : object
        As `ReachProblem.replace` takes it, or as a problem file holds it.

    Raises
    ------
    KinarmError
        If there is no such field, or it cannot have the value.
    """
    names = path.split(".")
    if len(names) == 1:
        return problem.replace(**{path: value})
    entries = problem.to_json()
    kind: Any = ReachProblem
    table = entries
    for depth, name in enumerate(names):
        known = init_fields(kind) if isinstance(kind, type) and is_dataclass(kind) else {}
        if name not in known:
            where = PROBLEM + ".".join(names[:depth])
            raise UnknownNameError(f"field of {where.removesuffix('.')}", name, known)
        if depth == len(names) - 1:
            table[name] = value
        else:
            kind = alternatives(field_types(kind)[name])[0]
            table = table.setdefault(name, {})
    if names[0] == "arm":
        entries["arm"].pop("digest", None)
    return from_plain(ReachProblem, entries, "problem")
