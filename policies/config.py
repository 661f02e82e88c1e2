"""Settings that every learner has, and checks that settings share."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from kinarm._fields import check_fields, init_fields
from kinarm._validation import whole_number
from kinarm.errors import InvalidInputError
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.task import RewardWeights

if TYPE_CHECKING:
    from kinarm.simulator import Simulator

Schedule = Literal["constant", "linear"]
"""Whether a setting stays or falls linearly to zero in the course of a training."""


def scheduled(value: float, schedule: Schedule, done: float) -> float:
    """Value of a setting in the course of a training.

    Parameters
    ----------
    value : float
        Value at the beginning, in the unit of the setting.
    schedule : {"constant", "linear"}
        Whether it stays or falls linearly to zero.
    done : float
        Share of the training that is done, in [0, 1].
    """
    return value if schedule == "constant" else value * (1 - done)


POSITIVE = {"must": "be greater than 0", "holds": lambda value: value > 0}
NOT_NEGATIVE = {"must": "not be negative", "holds": lambda value: value >= 0}
SHARE = {"must": "lie in [0, 1]", "holds": lambda value: 0 <= value <= 1}
"""Range of a number: metadata of a field."""

LARGEST = 1e6
"""Numbers of settings at most; parameters would overflow with larger ones."""

MANY, WIDTHS = {"at_most": 100_000}, {"at_most": 4096}
"""Metadata of whole numbers that memory grows with, and of the widths of hidden layers."""


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


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """Settings of a training with any learner, which adds its own.

    Parameters
    ----------
    problem : ReachProblem
        The problem that the policy is for; a name or a file will do.
    reward : RewardWeights, optional
        What the learner is rewarded for; what the task rewards if it is not given.
    seed : int
        Seed of all randomness.
    recipe : str
        Name of these settings, for the record.
    iterations : int
        Updates of the parameters.
    """

    problem: ReachProblem = PROBLEMS["right"]
    reward: RewardWeights | None = None
    seed: int = field(default=0, metadata={"at_least": 0})
    recipe: str = "custom"
    iterations: int = 1

    def __post_init__(self) -> None:
        object.__setattr__(self, "problem", ReachProblem.load(self.problem))
        check_fields(self)
        for name, item in init_fields(type(self)).items():
            check_range(name, getattr(self, name), item.metadata)

    @property
    def training_problem(self) -> ReachProblem:
        """The problem with the reward of these settings, on which the training runs."""
        return self.problem.replace(reward=self.reward)

    @property
    def learner(self) -> str:
        """Name by which the learner is found; ``LEARNER`` of its module if it says no more."""
        return f"{type(self).__module__}:LEARNER"

    @property
    def can_extend(self) -> bool:
        """Whether a training with more iterations begins just as this one goes."""
        return False

    def simulator(self, threads: int | None = None) -> "Simulator":
        """Build the simulator to train in."""
        from kinarm.simulator import Simulator

        return Simulator(self.training_problem, threads=threads)

    def changed(self, changes: Mapping[str, Any]) -> "TrainingConfig":
        """Replace fields; a mapping for the reward replaces the weights that it names."""
        given = dict(changes)
        if isinstance(given.get("reward"), Mapping):
            problem = self.training_problem.replace(reward=given["reward"])
            given["reward"] = problem.task.reward
        return replace(self, **given)


ConfigT = TypeVar("ConfigT", bound=TrainingConfig)
