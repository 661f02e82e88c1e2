"""Which trainings a study of transfer consists of."""

import hashlib
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import cache, cached_property
from itertools import product
from typing import TYPE_CHECKING, Any, Literal

from kinarm import SEMANTICS
from kinarm._fields import to_plain
from kinarm._validation import MOST_TRIALS, whole_number
from kinarm.policies.config import TrainingConfig
from kinarm.policies.provenance import package_versions
from kinarm.policies.recipes import recipe
from kinarm.problem import PROBLEMS, ReachProblem

if TYPE_CHECKING:
    from kinarm.evaluation.studies.transfer.study import TransferStudy

Role = Literal["source", "scratch", "warm"]
"""A training on the first task, or one on another task that begins with nothing or with it."""

FIRST_SEEDS: dict[Role, int] = {"source": 0, "scratch": 1000, "warm": 2000}
"""Training seeds by role: no two trainings of a learner on a task share random numbers."""

MOST_SEEDS = 1000

SOURCE = PROBLEMS["left"]
"""The paper's task 1."""

OTHER_ARM = "lrmate200ic_5l"


@cache
def targets() -> tuple[ReachProblem, ...]:
    """The paper's tasks 2 and 3, and task 1 of another arm."""
    other = SOURCE.replace(name=f"{SOURCE.name}-{OTHER_ARM}", arm=OTHER_ARM)
    return PROBLEMS["right"], PROBLEMS["both"], other


@dataclass(frozen=True, kw_only=True)
class Protocol:
    """How policies are judged.

    Parameters
    ----------
    trials, seed : int
        Size and seed of the set of trials that trained policies face.
    looks : int
        How often a policy is judged in the course of a training, at most; the iterations between
        two looks grow geometrically.
    look_trials, look_seed : int
        Size and seed of the set of trials that it then faces.

    Raises
    ------
    InvalidInputError
        If a number is out of range.
    """

    trials: int = 4000
    seed: int = 0
    looks: int = 80
    look_trials: int = 1000
    look_seed: int = 1

    def __post_init__(self) -> None:
        for name in ("trials", "look_trials"):
            whole_number(name, getattr(self, name), 2, MOST_TRIALS)
        for name in ("seed", "look_seed"):
            whole_number(name, getattr(self, name), 0)
        whole_number("looks", self.looks, 2)


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedTraining:
    """A training of a study.

    Attributes
    ----------
    role : {"source", "scratch", "warm"}
        What it is for.
    config : TrainingConfig
        Its settings, but for the policy that it begins with.
    length : float
        Its iterations as a share of the recipe's.
    protocol : Protocol
        How it is judged.
    source : PlannedTraining, optional
        The training with whose policy it begins.
    """

    role: Role
    config: TrainingConfig
    length: float
    protocol: Protocol
    source: "PlannedTraining | None" = None

    @property
    def learner(self) -> str:
        """Name of the learner."""
        from kinarm.policies.learners import learner_of

        return learner_of(self.config).name

    @property
    def problem(self) -> ReachProblem:
        """What is learnt."""
        return self.config.problem

    @property
    def cost(self) -> float:
        """Rough duration [s of a core]."""
        return self.config.cost

    @cached_property
    def settings(self) -> dict[str, Any]:
        """Everything that it depends on, as JSON holds it."""
        return {
            "role": self.role,
            "config": to_plain(replace(self.config, problem=self.problem.pinned)),
            "protocol": asdict(self.protocol),
            "source": self.source and self.source.name,
            "semantics": SEMANTICS,
            "versions": package_versions(),
        }

    @cached_property
    def name(self) -> str:
        """File name; other settings have another one."""
        digest = hashlib.sha256(json.dumps(self.settings, sort_keys=True).encode()).hexdigest()
        parts = (self.learner, self.role, self.problem.name, f"seed{self.config.seed}", digest[:8])
        return "-".join(parts)


def planned_trainings(study: "TransferStudy") -> Iterator[PlannedTraining]:
    """All trainings of a study; those that others begin with come first."""
    begun: dict[tuple[str, int], PlannedTraining] = {}
    for learner in study.learners:
        config = _tuned(study, learner, SOURCE)
        for seed in range(study.seeds):
            begun[learner, seed] = _planned(study, "source", config, seed)
    yield from begun.values()
    for problem, learner in product(targets(), study.learners):
        config = _tuned(study, learner, problem)
        for length, seed in product(study.lengths, range(study.seeds)):
            yield _planned(study, "scratch", config, seed, length)
            yield _planned(study, "warm", config, seed, length, begun[learner, seed])


def _tuned(study: "TransferStudy", learner: str, problem: ReachProblem) -> TrainingConfig:
    """The recipe ``tuned`` without its mirror."""
    changed = study.settings.get(learner, {})
    config: TrainingConfig = recipe(learner, "tuned", problem=problem, symmetric=False, **changed)
    return config


def _planned(
    study: "TransferStudy",
    role: Role,
    config: TrainingConfig,
    seed: int,
    length: float = 1.0,
    source: PlannedTraining | None = None,
) -> PlannedTraining:
    """A training with a recipe; it has a seed, and a share of the iterations."""
    iterations = max(1, round(length * config.iterations))
    return PlannedTraining(
        role=role,
        config=replace(config, seed=FIRST_SEEDS[role] + seed, iterations=iterations),
        length=length,
        protocol=study.protocol,
        source=source,
    )
