"""Settings that every learner has, and checks that settings share."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from numbers import Real
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin, get_type_hints

from kinarm._fields import alternatives, init_fields
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


POSITIVE = {"must": "be greater than 0", "holds": lambda value: value > 0}
NOT_NEGATIVE = {"must": "not be negative", "holds": lambda value: value >= 0}
SHARE = {"must": "lie in [0, 1]", "holds": lambda value: 0 <= value <= 1}
"""What a number must be: metadata of a field."""


def checked(name: str, value: Any, hint: Any, demands: Mapping[str, Any]) -> Any:
    """Return a setting, in Python's own type, or refuse it.

    Parameters
    ----------
    name : str
        Name of the setting.
    value : object
        Its value.
    hint : type
        Type that it must have; numbers, choices and tuples of whole numbers are checked.
    demands : mapping
        What a number must be, such as `POSITIVE`; for whole numbers ``at_least``, by default 1.

    Raises
    ------
    InvalidInputError
        If the value has another type or is out of range.
    """
    if hint is int:
        return whole_number(name, value, demands.get("at_least", 1))
    if hint == tuple[int, ...]:
        return tuple(whole_number(name, each, 1) for each in value)
    if get_origin(hint) is Literal and value not in get_args(hint):
        raise InvalidInputError(f"{name} must be one of {', '.join(get_args(hint))}, got {value!r}")
    if hint is not float:
        return value
    finite = isinstance(value, Real) and math.isfinite(value)
    if not (finite and ("holds" not in demands or demands["holds"](value))):
        raise InvalidInputError(f"{name} must {demands.get('must', 'be finite')}, got {value}")
    return float(value)


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
        hints = get_type_hints(type(self))
        for name, item in init_fields(type(self)).items():
            hint, value = alternatives(hints[name])[0], getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, checked(name, value, hint, item.metadata))

    @property
    def training_problem(self) -> ReachProblem:
        """The problem with the reward of these settings, which is what is trained on."""
        return self.problem.replace(reward=self.reward)

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
