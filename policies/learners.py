"""What a learner is, where learners are found, and the loop that they all train in.

A learner is a module with an attribute ``LEARNER`` and an entry in the registry; it needs no base
class. The module of ARS, for example, is ``kinarm.policies.ars``.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, Protocol, TypeVar

from kinarm.errors import InvalidInputError, MissingExtraError, UnknownNameError
from kinarm.policies.config import TrainingConfig
from kinarm.policies.curve import CurvePoint

if TYPE_CHECKING:
    from kinarm.policies.policy import Policy


@dataclass(frozen=True, kw_only=True, eq=False)
class TrainingState:
    """Everything that the next iteration depends on; learners add fields of their own.

    A checkpoint holds all fields: numbers, arrays, dictionaries that JSON can hold, and
    dataclasses or named tuples of these.

    Attributes
    ----------
    curve : tuple of CurvePoint
        One point per finished iteration.
    """

    curve: tuple[CurvePoint, ...] = ()

    @property
    def iteration(self) -> int:
        """Number of finished iterations."""
        return len(self.curve)

    @property
    def environment_steps(self) -> int:
        """Steps taken so far."""
        return self.curve[-1].environment_steps if self.curve else 0

    @property
    def wall_time(self) -> float:
        """Time that the iterations took so far [s]."""
        return self.curve[-1].wall_time if self.curve else 0.0


ConfigT = TypeVar("ConfigT", bound=TrainingConfig)
StateT = TypeVar("StateT", bound=TrainingState)


class Training(Protocol[StateT]):
    """A running training: built once, it serves every iteration."""

    def initial_state(self) -> StateT:
        """State before the first iteration."""

    def iterate(self, state: StateT) -> StateT:
        """One iteration: the state after it, whose curve has one more point."""


@dataclass(frozen=True, kw_only=True)
class Learner(Generic[ConfigT, StateT]):
    """What a learner offers.

    Parameters
    ----------
    name : str
        Its name on the command line and in files.
    title : str
        Its name in words.
    config, state : type
        Settings, and state of a training.
    recipes : mapping of str to config
        Settings by name; ``"paper"`` has to be among them.
    summaries : mapping of str to str
        What recipes are, in a few words by name, for help.
    begin : callable
        Prepares a training, given settings and options.
    policy : callable
        Freezes a state into a policy, given settings and state.
    adapt : callable, optional
        Adapts a recipe to the problem that it is for.
    options : tuple of str
        Names of the options that ``begin`` takes.
    packages : tuple of str
        Modules that it needs beyond what kinarm requires.
    extra : str
        The extra of kinarm that brings them.
    """

    name: str
    title: str
    config: type[ConfigT]
    state: type[StateT]
    recipes: Mapping[str, ConfigT]
    begin: Callable[..., Training[StateT]]
    policy: Callable[[ConfigT, StateT], "Policy"]
    summaries: Mapping[str, str] = field(default_factory=dict)
    adapt: Callable[[ConfigT], ConfigT] = lambda config: config
    options: tuple[str, ...] = ()
    packages: tuple[str, ...] = ()
    extra: str = ""

    def check_installed(self, *others: str) -> None:
        """Refuse to go on without the packages that the learner needs, and others.

        Raises
        ------
        MissingExtraError
            If one is missing; it says how to install it.
        """
        for package in (*self.packages, *others):
            if find_spec(package) is None:
                raise MissingExtraError(package, self.extra)


def imported(module: str, name: str) -> Callable[..., Any]:
    """A callable of a module that is imported when it is first called: it takes long to load."""
    return lambda *given, **options: getattr(import_module(module), name)(*given, **options)


class TrainingResult(NamedTuple):
    """A trained policy and how it came about.

    Attributes
    ----------
    policy : Policy
        The trained policy.
    curve : tuple of CurvePoint
        One point per iteration.
    state : TrainingState
        The state that the policy was made of.
    """

    policy: "Policy"
    curve: tuple[CurvePoint, ...]
    state: Any

    def __repr__(self) -> str:
        steps = self.curve[-1].environment_steps if self.curve else 0
        made = f"{len(self.curve)} iterations, {steps / 1e6:.3g} million steps"
        return f"{type(self).__name__}({self.policy!r}, {made})"


_MODULES = {"ars": "kinarm.policies.ars", "ppo": "kinarm.policies.ppo"}


def register_learner(name: str, module: str) -> None:
    """Make a learner known, for this process.

    Parameters
    ----------
    name : str
        Its name.
    module : str
        The module whose attribute ``LEARNER`` is the learner; imported when it is first needed.
    """
    _MODULES[name] = module


def learner_names() -> tuple[str, ...]:
    """Names of all learners."""
    return tuple(_MODULES)


def find_learner(name: str) -> Learner[Any, Any]:
    """Look a learner up by name.

    Raises
    ------
    UnknownNameError
        If there is no such learner.
    """
    if name not in _MODULES:
        raise UnknownNameError("learner", name, _MODULES)
    learner: Learner[Any, Any] = import_module(_MODULES[name]).LEARNER
    return learner


def learner_of(config: TrainingConfig) -> Learner[Any, Any]:
    """Look up the learner that settings are for.

    Raises
    ------
    InvalidInputError
        If they are no learner's.
    """
    for name in _MODULES:
        learner = find_learner(name)
        if type(config) is learner.config:
            return learner
    raise InvalidInputError(f"expected settings of {', '.join(_MODULES)}, got {config!r}")


def train_policy(
    config: TrainingConfig,
    *,
    state: TrainingState | None = None,
    on_iteration: Callable[[Any], object] | None = None,
    **options: Any,
) -> TrainingResult:
    """Train a policy.

    Parameters
    ----------
    config : ARSConfig, PPOConfig or settings of another learner
        The settings.
    state : TrainingState, optional
        Where to go on; the result equals that of an uninterrupted training bit for bit.
    on_iteration : callable, optional
        Called with the state after every iteration.
    **options
        What does not change the result: ``threads``, and the folder of the ``tensorboard`` logs
        for PPO.

    Raises
    ------
    MissingExtraError
        If a package that the learner needs is not installed.
    InvalidInputError
        If the state is not one of such a training.
    """
    training = begin_training(config, **options)
    return run_training(config, training, state=state, on_iteration=on_iteration)


def thread_options(config: TrainingConfig, threads: int) -> dict[str, int]:
    """Options of a training on so many threads; none if its learner does not ask for them."""
    return {"threads": threads} if "threads" in learner_of(config).options else {}


def begin_training(config: TrainingConfig, **options: Any) -> Training[Any]:
    """Prepare a training, and refuse what cannot be trained; see `train_policy`."""
    learner = learner_of(config)
    learner.check_installed()
    for option in options:
        if option not in learner.options:
            raise InvalidInputError(f"{learner.name} has no option {option!r}")
    return learner.begin(config, **options)


def run_training(
    config: TrainingConfig,
    training: Training[Any],
    *,
    state: TrainingState | None = None,
    on_iteration: Callable[[Any], object] | None = None,
) -> TrainingResult:
    """Iterate until the training is complete; see `train_policy`."""
    if state is None:
        state = training.initial_state()
    while state.iteration < config.iterations:
        state = training.iterate(state)
        if on_iteration is not None:
            on_iteration(state)
    return TrainingResult(state_policy(config, state), state.curve, state)


def state_policy(config: TrainingConfig, state: TrainingState) -> "Policy":
    """Freeze a state of a training into a policy, with all that belongs to it."""
    return learner_of(config).policy(config, state)
