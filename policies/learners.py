"""The contract of learners, how they are found, and the loop that trains them.

A learner is an attribute ``LEARNER`` of a module, such as `kinarm.policies.ars`. Those of other
packages are found by name in the entry-point group ``kinarm.learners``, or as ``module:LEARNER``.
"""

import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, Protocol, TypeVar

from kinarm._files import first_line
from kinarm.errors import InvalidInputError, MissingExtraError, UnknownNameError
from kinarm.policies.config import ConfigT, TrainingConfig

if TYPE_CHECKING:
    from kinarm.policies.policy import Policy


class CurvePoint(NamedTuple):
    """A point of a learning curve: one iteration.

    Attributes
    ----------
    mean_return, std_return, success : float
        Mean and standard deviation of the returns of the iteration's episodes,
        and share of success; for PPO, of those that ended in it, and for
        Stable-Baselines3, of the last hundred that ended. Replays of failed
        scenarios do not count; NaN if no episode does.
    environment_steps, wall_time : int and float
        Steps and time of the iterations [s] since the training began.
    """

    mean_return: float
    std_return: float
    success: float
    environment_steps: int
    wall_time: float


@dataclass(frozen=True, kw_only=True, eq=False)
class TrainingState:
    """Everything that the next iteration depends on; learners add fields of their own.

    A checkpoint holds all fields: numbers, arrays, dictionaries for JSON, and dataclasses or named
    tuples of these. The curve has one point per finished iteration.
    """

    curve: tuple[CurvePoint, ...] = ()

    @property
    def iteration(self) -> int:
        """Number of finished iterations."""
        return len(self.curve)

    def curve_with(self, point: CurvePoint) -> tuple[CurvePoint, ...]:
        """The curve and one more point; to unpack it would take ten times as long."""
        return self.curve + (point,)  # noqa: RUF005

    @property
    def environment_steps(self) -> int:
        """Steps taken so far."""
        return self.curve[-1].environment_steps if self.curve else 0

    @property
    def wall_time(self) -> float:
        """Time of the iterations so far [s]."""
        return self.curve[-1].wall_time if self.curve else 0.0


StateT = TypeVar("StateT", bound=TrainingState)


class Training(Protocol[StateT]):
    """A running training, built once."""

    def initial_state(self) -> StateT:
        """State before the first iteration."""

    def iterate(self, state: StateT) -> StateT:
        """The state after one iteration, whose curve has one more point."""


@dataclass(frozen=True, kw_only=True)
class Learner(Generic[ConfigT, StateT]):
    """A learner: its settings, recipes and training.

    Parameters
    ----------
    name, title : str
        Name in commands and files, and in words.
    config, state : type
        Settings, and state of a training.
    recipes : mapping of str to config
        Settings by name; the first one is the default.
    summaries : mapping of str to str
        What recipes are, in a few words, for help.
    begin : callable
        Prepares a training, given settings and the number of threads that it
        may take, None for all processors; results do not depend on it.
    policy : callable
        Freezes a state into a policy, given settings and state.
    adapt : callable, optional
        Adapts a recipe to the problem that it is for.
    packages, extra : tuple of str, and str
        Modules that it needs beyond kinarm's, and the extra that brings them.
    """

    name: str
    title: str
    config: type[ConfigT]
    state: type[StateT]
    recipes: Mapping[str, ConfigT]
    begin: Callable[[ConfigT, int | None], Training[StateT]]
    policy: Callable[[ConfigT, StateT], "Policy"]
    summaries: Mapping[str, str] = field(default_factory=dict)
    adapt: Callable[[ConfigT], ConfigT] = lambda config: config
    packages: tuple[str, ...] = ()
    extra: str = ""

    @property
    def first_recipe(self) -> str:
        """Name of the default recipe."""
        return next(iter(self.recipes))

    def check_installed(self) -> None:
        """Refuse to go on without the packages it needs."""
        for package in self.packages:
            if find_spec(package) is None:
                raise MissingExtraError(package, self.extra)


def imported(module: str, name: str) -> Callable[..., Any]:
    """A callable of a module that is imported late, since it takes long."""
    return lambda *given: getattr(import_module(module), name)(*given)


class TrainingResult(NamedTuple):
    """A trained policy, its learning curve, and its `TrainingState`."""

    policy: "Policy"
    curve: tuple[CurvePoint, ...]
    state: Any

    def __repr__(self) -> str:
        steps = self.curve[-1].environment_steps if self.curve else 0
        made = f"{len(self.curve)} iterations, {steps / 1e6:.3g} million steps"
        return f"{type(self).__name__}({self.policy!r}, {made})"


GROUP = "kinarm.learners"
"""Entry-point group in which packages name their learners."""

_SHIPPED = {
    "ars": "kinarm.policies.ars:LEARNER",
    "ppo": "kinarm.policies.ppo:LEARNER",
    "a2c": "kinarm.policies.sb3:A2C",
    "ddpg": "kinarm.policies.sb3:DDPG",
    "sac": "kinarm.policies.sb3:SAC",
    "sb3-ppo": "kinarm.policies.sb3:PPO",
    "td3": "kinarm.policies.sb3:TD3",
    "tqc": "kinarm.policies.sb3:TQC",
    "trpo": "kinarm.policies.sb3:TRPO",
}


@cache
def _installed() -> dict[str, str]:
    """Places of the learners of installed packages, by name."""
    return {point.name: point.value for point in entry_points(group=GROUP)}


def learner_names() -> tuple[str, ...]:
    """Names of learners, kinarm's and those of installed packages."""
    return tuple({**_SHIPPED, **_installed()})


def look_here() -> None:
    """Find modules in the current folder before others."""
    if (here := str(Path.cwd())) not in sys.path:
        sys.path.insert(0, here)


def find_learner(name: str) -> Learner[Any, Any]:
    """Look a learner up by name or ``module:LEARNER``, also in the current folder.

    Raises
    ------
    InvalidInputError
        If there is none, it cannot be imported, or is something else.
    """
    place = name if ":" in name else _SHIPPED.get(name) or _installed().get(name)
    if place is None:
        raise UnknownNameError("learner", name, (*learner_names(), "module:LEARNER"))
    if place is name:
        look_here()
    module, _, attribute = place.partition(":")
    try:
        found = getattr(import_module(module), attribute)
    except Exception as error:  # a module can raise anything
        raise InvalidInputError(f"cannot import learner {name!r}: {first_line(error)}") from error
    if not isinstance(found, Learner):
        raise InvalidInputError(f"learner {name!r} is no kinarm.policies.Learner: it is {found!r}")
    return found


def train_policy(
    config: TrainingConfig,
    *,
    state: TrainingState | None = None,
    on_iteration: Callable[[Any], object] | None = None,
    threads: int | None = None,
) -> TrainingResult:
    """Train a policy.

    Parameters
    ----------
    config : ARSConfig, PPOConfig or settings of another learner
        The settings.
    state : TrainingState, optional
        Where to go on, bit for bit as without an interruption.
    on_iteration : callable, optional
        Called with the state after every iteration.
    threads : int, optional
        How many it takes, by default as many as there are processors; results
        do not depend on it.
    """
    states = training_states(config, state, threads)
    last = next(states)
    for last in states:
        if on_iteration is not None:
            on_iteration(last)
    return TrainingResult(state_policy(config, last), last.curve, last)


def training_states(
    config: TrainingConfig, state: TrainingState | None = None, threads: int | None = None
) -> Iterator[Any]:
    """States of a training: the given or initial one, then one per iteration.

    Parameters
    ----------
    config, state, threads
        See `train_policy`.
    """
    learner = find_learner(config.learner)
    learner.check_installed()
    training = learner.begin(config, threads)
    if state is None:
        state = training.initial_state()
    yield state
    while state.iteration < config.iterations:
        state = training.iterate(state)
        yield state


def state_policy(config: TrainingConfig, state: TrainingState) -> "Policy":
    """Freeze a state of a training into a policy, which keeps the shield that it learnt behind."""
    policy = find_learner(config.learner).policy(config, state)
    if not config.problem.stepping.shield:
        return policy
    made = replace(policy.provenance, problem=policy.problem.replace(shield=False))
    return replace(policy, provenance=made, shield=True)
