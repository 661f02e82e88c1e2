"""Settings that every learner has."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from kinarm._fields import Checked
from kinarm.errors import FROM_ZERO
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.task import RewardWeights

if TYPE_CHECKING:
    from kinarm.simulator import Simulator

Schedule = Literal["constant", "linear"]
"""Whether a setting stays or falls linearly to zero in a training."""


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


def merged(own: Any, given: Any) -> Any:
    """Copy what is given; a mapping keeps the entries of an own one that it does not name."""
    if not isinstance(given, Mapping):
        return given
    kept = own if isinstance(own, Mapping) else {}
    return {**kept, **{name: merged(kept.get(name), entry) for name, entry in given.items()}}


MANY, WIDTHS = {"at_most": 100_000}, {"at_most": 4096}
"""Metadata of numbers that memory grows with, and of widths of layers."""


@dataclass(frozen=True, kw_only=True)
class TrainingConfig(Checked):
    """Settings of all learners, which add their own.

    Parameters
    ----------
    problem : ReachProblem
        The problem of the policy, its name or its file.
    reward : RewardWeights, optional
        What the learner is rewarded for; by default as in the task.
    seed : int
        Seed of all randomness.
    recipe : str
        Name of these settings, for the record.
    iterations : int
        Updates of the parameters.
    """

    problem: ReachProblem = PROBLEMS["right"]
    reward: RewardWeights | None = None
    seed: int = field(default=0, metadata=FROM_ZERO)
    recipe: str = "custom"
    iterations: int = 1

    def __post_init__(self) -> None:
        object.__setattr__(self, "problem", ReachProblem.load(self.problem))
        super().__post_init__()

    @property
    def training_problem(self) -> ReachProblem:
        """The problem with the reward of these settings."""
        return self.problem.replace(reward=self.reward)

    @property
    def learner(self) -> str:
        """Name of the learner; by default ``LEARNER`` of its module."""
        return f"{type(self).__module__}:LEARNER"

    def simulator(self, threads: int | None = None) -> "Simulator":
        """Build the simulator to train in."""
        from kinarm.simulator import Simulator

        return Simulator(self.training_problem, threads=threads)

    def changed(self, changes: Mapping[str, Any]) -> "TrainingConfig":
        """Replace fields; a mapping replaces weights, or entries at any depth, that it names."""
        given = {name: merged(getattr(self, name), value) for name, value in changes.items()}
        if isinstance(given.get("reward"), Mapping):
            problem = self.training_problem.replace(reward=given["reward"])
            given["reward"] = problem.task.reward
        return replace(self, **given)


ConfigT = TypeVar("ConfigT", bound=TrainingConfig)
