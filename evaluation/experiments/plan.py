"""From an experiment to its trainings."""

import hashlib
import json
import pickle
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, is_dataclass, replace
from dataclasses import fields as dataclass_fields
from functools import cached_property
from itertools import product
from typing import Any

from kinarm import SEMANTICS
from kinarm._fields import alternatives, field_types, from_plain, init_fields, to_plain
from kinarm.errors import InvalidInputError, KinarmError, UnknownNameError
from kinarm.evaluation.experiments.curve import TrialSettings
from kinarm.evaluation.experiments.experiment import Entry, Experiment
from kinarm.evaluation.experiments.variation import combinations
from kinarm.policies.config import TrainingConfig
from kinarm.policies.learners import Learner, find_learner
from kinarm.policies.recipes import recipe
from kinarm.problem import ReachProblem

PROBLEM = "problem."
"""What the path of a field of the problem begins with."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """One training of an experiment.

    Attributes
    ----------
    learner : str
        Name of the learner.
    config : TrainingConfig
        All of its settings; the arm of the problem is pinned.
    trials : TrialSettings
        Which trials its policies face.
    choices : mapping
        What of it varies in the experiment, by field.
    entry : Entry
        What it belongs to.
    plain : mapping, optional
        The settings as JSON holds them, where they are known already.
    """

    learner: str
    config: TrainingConfig
    trials: TrialSettings
    choices: Mapping[str, Any] = field(default_factory=dict)
    entry: Entry = field(default_factory=Entry)
    plain: Mapping[str, Any] | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        fields = {item.name: getattr(self, item.name) for item in dataclass_fields(self)}
        return _unpacked, (self.learner, pickle.dumps(fields))

    @cached_property
    def settings(self) -> dict[str, Any]:
        """Everything that its results depend on, as JSON holds it."""
        return {
            "learner": self.learner,
            "config": to_plain(self.config) if self.plain is None else self.plain,
            "trials": to_plain(self.trials),
            "semantics": SEMANTICS,
        }

    @classmethod
    def of_settings(cls, settings: Mapping[str, Any], where: str) -> "Run":
        """The training with these settings; its place in an experiment is not known.

        Parameters
        ----------
        settings : mapping
            What `settings` told.
        where : str
            Name of the file that holds them, for messages.

        Raises
        ------
        KinarmError
            If they cannot be used.
        """
        learner = find_learner(settings["learner"])
        return cls(
            learner=settings["learner"],
            config=from_plain(learner.config, settings["config"], where),
            trials=from_plain(TrialSettings, settings["trials"], where),
        )

    @cached_property
    def key(self) -> str:
        """Hash of the settings; the name of its files."""
        return hash_of(self.settings)

    @cached_property
    def base_key(self) -> str:
        """Hash of the settings but for the number of iterations."""
        config = {k: v for k, v in self.settings["config"].items() if k != "iterations"}
        return hash_of({**self.settings, "config": config})

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


def _unpacked(learner: str, fields: bytes) -> Run:
    """A run in another process, which first finds its learner, wherever that is."""
    find_learner(learner)
    return Run(**pickle.loads(fields))


def hash_of(entries: Any) -> str:
    """Hash of what JSON can hold."""
    return hashlib.sha256(json.dumps(entries, sort_keys=True).encode()).hexdigest()[:20]


def plan(
    experiment: Experiment, choices: Sequence[Mapping[str, Any]] | None = None
) -> tuple[Run, ...]:
    """All trainings of an experiment, seed by seed, so that the first results cover everything.

    Parameters
    ----------
    experiment : Experiment
        The experiment.
    choices : sequence of mappings, optional
        Values of what varies, by field; those of the experiment by default.

    Raises
    ------
    KinarmError
        If a name is unknown, a value has the wrong type or is refused; in one line that names the
        field.
    """
    _check_fields_known(experiment)
    varied = list(experiment.choices()) if choices is None else choices
    each = [
        setting
        for entry in experiment.all_entries
        for problem in entry.problems or experiment.problems
        for setting in _settings(experiment, entry, ReachProblem.load(problem), varied)
    ]
    plain = [to_plain(config) for _, config, _ in each]
    most = max((entry.seeds or experiment.seeds for entry in experiment.all_entries), default=0)
    found: dict[tuple[str, str], Run] = {}
    for number in range(most):
        for (entry, config, chosen), entries in zip(each, plain, strict=True):
            if number < (entry.seeds or experiment.seeds):
                first = experiment.first_seed if entry.first_seed is None else entry.first_seed
                run = Run(
                    learner=entry.learner,
                    config=replace(config, seed=first + number),
                    trials=experiment.trials,
                    choices=chosen,
                    entry=entry,
                    plain={**entries, "seed": first + number},
                )
                found.setdefault((entry.name, run.key), run)
    return tuple(found.values())


def _check_fields_known(experiment: Experiment) -> None:
    """Refuse a field that none of the learners has."""
    shared = {**experiment.fixed, **next(experiment.choices()), **experiment.searched}
    every = [entry.learner for entry in experiment.all_entries]
    own = [({**each.fixed, **each.grid}, [each.learner]) for each in experiment.entries]
    for keys, names in [(shared, every), *own]:
        learners = {learner.name: learner for learner in map(find_learner, names)}
        fields_of = {name: init_fields(learner.config) for name, learner in learners.items()}
        available = dict.fromkeys(name for each in fields_of.values() for name in each)
        for key in keys:
            owner, _, rest = key.partition(".")
            fields, name = tuple(available), owner
            if owner in learners:
                fields, name = tuple(fields_of[owner]), rest.partition(".")[0]
            if name not in fields or name in CHOSEN:
                known = [each for each in fields if each not in CHOSEN]
                raise UnknownNameError("field of a recipe or problem", key, known)


CHOSEN = ("seed", "recipe")
"""Settings that the experiment chooses."""


def _settings(
    experiment: Experiment,
    entry: Entry,
    problem: ReachProblem,
    varied: Sequence[Mapping[str, Any]],
) -> Iterator[tuple[Entry, TrainingConfig, dict[str, Any]]]:
    """Settings of an entry on a problem, and what of them varies."""
    learner = find_learner(entry.learner)
    others = {find_learner(each.learner).name for each in experiment.all_entries} - {learner.name}
    fixed = {**_concerning(experiment.fixed, learner, others), **entry.fixed}
    seen = set()
    for choice, own in product(varied, combinations(entry.grid)):
        choices = {**_concerning(choice, learner, others), **own}
        if (key := repr(sorted(choices.items()))) not in seen:
            seen.add(key)
            yield entry, _config(entry, problem, {**fixed, **choices}), choices


def _concerning(
    entries: Mapping[str, Any], learner: Learner[Any, Any], others: Collection[str]
) -> dict[str, Any]:
    """Entries that concern a learner, without its name; not those that only others have."""
    owned, known = {}, init_fields(learner.config)
    for key, value in entries.items():
        owner, _, rest = key.partition(".")
        if owner == learner.name:
            owned[rest] = value
        elif owner not in others and owner in known:
            owned[key] = value
    return owned


def _config(entry: Entry, problem: ReachProblem, entries: Mapping[str, Any]) -> TrainingConfig:
    """A recipe for a problem, with some fields of both changed."""
    of_recipe: dict[str, Any] = {}
    outer: dict[str, Any]
    for key, value in entries.items():
        if key.startswith(PROBLEM):
            with _naming(key):
                problem = changed_problem(problem, key.removeprefix(PROBLEM), value)
        else:
            outer, (*path, name) = of_recipe, key.split(".")
            for part in path:
                outer = outer.setdefault(part, {})
            outer[name] = value
    config: TrainingConfig = recipe(
        entry.learner, entry.recipe or None, problem=problem.pinned, **of_recipe
    )
    return config


@contextmanager
def _naming(key: str) -> Iterator[None]:
    """Say in an error which field of the experiment it is about."""
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
