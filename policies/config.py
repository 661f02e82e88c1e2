"""Settings that every learner has, and checks that settings share."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin

from kinarm._fields import type_hints
from kinarm._validation import whole_number
from kinarm.errors import InvalidInputError
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.task import RewardWeights

if TYPE_CHECKING:
    from kinarm.simulator import Simulator

Schedule = Literal["constant", "linear"]
"""Whether a setting stays or falls linearly to zero in the course of a training."""


def scheduled(value: float, schedule: Schedule, done: float) -> float:
    """Value of a setting after this share of the training."""
    return value if schedule == "constant" else value * (1 - done)


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
    seed: int = 0
    recipe: str = "custom"
    iterations: int = 1

    def __post_init__(self) -> None:
        object.__setattr__(self, "problem", ReachProblem.load(self.problem))
        self._check_whole_numbers(("seed",), at_least=0)
        self._check_whole_numbers(("iterations",))
        for name, hint in type_hints(type(self)).items():
            if get_origin(hint) is Literal and getattr(self, name) not in get_args(hint):
                choices = ", ".join(get_args(hint))
                raise InvalidInputError(
                    f"{name} must be one of {choices}, got {getattr(self, name)!r}"
                )

    def _check_whole_numbers(self, names: Iterable[str], at_least: int = 1) -> None:
        """Refuse what is no whole number, and make Python's integers of NumPy's."""
        for name in names:
            number = whole_number(name, getattr(self, name), at_least)
            object.__setattr__(self, name, number)

    def _check_above_zero(self, names: Iterable[str]) -> None:
        for name in names:
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InvalidInputError(f"{name} must be greater than 0, got {value}")

    def _check_shares(self, names: Iterable[str]) -> None:
        for name in names:
            if not 0 <= getattr(self, name) <= 1:
                raise InvalidInputError(f"{name} must lie in [0, 1], got {getattr(self, name)}")

    @property
    def training_problem(self) -> ReachProblem:
        """What is trained on: the problem with the reward of these settings."""
        return self.problem.replace(reward=self.reward)

    def simulator(self, threads: int | None = None) -> "Simulator":
        """Build the simulator to train in."""
        from kinarm.simulator import Simulator

        return Simulator(self.training_problem, threads=threads)

    def changed(self, changes: Mapping[str, Any]) -> "TrainingConfig":
        """Replace fields; a mapping for the reward replaces the weights that it names."""
        given = dict(changes)
        if isinstance(given.get("reward"), Mapping):
            problem = ReachProblem.load(given.get("problem", self.problem))
            weights = self.reward or problem.task.reward
            given["reward"] = replace(weights, **given["reward"])
        return replace(self, **given)
