"""The frame of every environment: its errors, its life, its specification, and how it is made."""

import json
from collections.abc import Mapping
from dataclasses import replace
from enum import Enum
from typing import Any, cast

import gymnasium.error
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.spaces import Box, Space
from numpy.typing import DTypeLike, NDArray

from kinarm._validation import finite_array
from kinarm.envs.infos import Contacts
from kinarm.envs.interface import Interface
from kinarm.envs.rendering import RENDER_MODES, EnvPictures
from kinarm.episodes import Episodes
from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.problem import ProblemLike, ReachProblem
from kinarm.simulator import Simulator

Array = NDArray[np.float64]

SETTINGS = (
    *("render_mode", "width", "height", "camera", "observation_dtype", "reward_type"),
    *("num_envs", "autoreset_mode", "threads", "vectorization_mode"),
)
"""Arguments of environments that are not part of their problem."""


class ResetNeededError(InvalidInputError, gymnasium.error.ResetNeeded):
    """An environment was stepped or rendered before its first reset."""


class ClosedEnvironmentError(InvalidInputError, gymnasium.error.ClosedEnvironmentError):
    """An environment was used after it was closed."""


class UnexpectedArgumentError(InvalidInputError, TypeError):
    """An environment cannot be made with an argument of this name.

    As everywhere in Python it is a TypeError, by which libraries that try arguments go.
    """


class Lifecycle:
    """An environment that refuses to be used before its first reset, and after its end."""

    closed: bool = False
    _episodes: Episodes | None = None

    @property
    def episodes(self) -> Episodes:
        """The episodes under way, one row per arm.

        Raises
        ------
        ClosedEnvironmentError
            If the environment is closed.
        ResetNeededError
            If it was never reset.
        """
        self._check_open()
        if self._episodes is None:
            raise ResetNeededError("the environment was never begun: call reset()")
        return self._episodes

    def _check_open(self) -> None:
        if self.closed:
            raise ClosedEnvironmentError("the environment is closed: make another one")


class ArmEnvironment(Lifecycle):
    """The common part of Gymnasium's environments of one arm and of many.

    Attributes
    ----------
    simulator : Simulator
        The simulator that is stepped.
    interface : Interface
        How it is shown.
    """

    simulator: Simulator
    interface: Interface
    _pictures: EnvPictures
    _contacts: Contacts
    _spec: EnvSpec | None = None

    @property
    def contact_names(self) -> tuple[tuple[str, str] | None, ...]:
        """Names of the two bodies of a contact, by its number in the info."""
        return self._contacts.names

    @property
    def spec(self) -> EnvSpec | None:
        """Specification that makes this environment again; it can be written as JSON."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = None if spec is None else portable_spec(spec, self.simulator)

    def _make_interface(self, simulator: Simulator, dtype: DTypeLike) -> Interface:
        """Choose how the simulator is shown."""
        return Interface(simulator, dtype)


def make_simulator(
    problem: ProblemLike, threads: int | None, overrides: Mapping[str, Any]
) -> Simulator:
    """Build the simulator of an environment from the environment's arguments.

    Parameters
    ----------
    problem : ReachProblem, str or Path
        The problem.
    threads : int, optional
        As for `kinarm.Simulator`.
    overrides : mapping
        Changes to the problem, for `kinarm.ReachProblem.replace`.

    Raises
    ------
    UnexpectedArgumentError
        If a problem has nothing of the name of a change.
    """
    try:
        return Simulator(ReachProblem.load(problem).replace(**overrides), threads=threads)
    except UnknownNameError as error:
        if error.given not in overrides:
            raise
        raise UnexpectedArgumentError(
            f"unexpected keyword argument {error.given!r}; available: {', '.join(error.available)}"
        ) from error


def action_space(simulator: Simulator) -> Space[Any]:
    """Fractions of the velocity limits."""
    return cast("Space[Any]", Box(-1.0, 1.0, (simulator.n_actions,), dtype=np.float32))


def environment_metadata(simulator: Simulator, **others: Any) -> dict[str, Any]:
    """Tell Gymnasium how an environment can be rendered, and how many steps make a second."""
    rate = round(1 / simulator.problem.stepping.time_step)
    return {"render_modes": list(RENDER_MODES), "render_fps": max(rate, 1), **others}


def pick_scenario(
    options: Mapping[str, Any] | None, start: Array, goal: Array
) -> tuple[Array, Array]:
    """Replace a start and a goal by those that the options of a reset set.

    Parameters
    ----------
    options : mapping, optional
        May hold ``start`` and ``goal``.
    start : ndarray, shape (n_joints,)
        Configuration that was drawn [rad or m].
    goal : ndarray, shape (3,)
        Position that was drawn [m].

    Raises
    ------
    InvalidInputError
        If an option is unknown, or has the wrong shape or an entry that is not finite.
    """
    given = dict(options or {})
    unknown = set(given) - {"start", "goal"}
    if unknown:
        raise InvalidInputError(f"unknown reset options {sorted(unknown)}; available: start, goal")
    return (
        finite_array("start", given.get("start", start), start.shape),
        finite_array("goal", given.get("goal", goal), goal.shape),
    )


def portable_spec(spec: EnvSpec, simulator: Simulator) -> EnvSpec:
    """Complete the specification of an environment, so that it can be written as JSON.

    It states the horizon. A problem, or changes to one, that JSON cannot hold are replaced by
    what `kinarm.ReachProblem.to_json` makes of the whole problem.
    """
    steps = spec.max_episode_steps or simulator.task.horizon
    given = {name: value for name, value in spec.kwargs.items() if name != "max_episode_steps"}
    settings = {name: _plain(given[name]) for name in SETTINGS if name in given}
    kwargs = {**given, **settings}
    try:
        json.dumps(kwargs)
    except TypeError:
        kwargs = {"problem": simulator.problem.to_json(), **settings}
    return replace(spec, kwargs=kwargs, max_episode_steps=steps)


def _plain(value: Any) -> Any:
    """A setting as JSON can hold it."""
    if isinstance(value, Enum):
        return value.value
    return np.dtype(value).name if isinstance(value, type | np.dtype) else value
