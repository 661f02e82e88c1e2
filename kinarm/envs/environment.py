"""The common part of all environments: life, specification, contacts, interface."""

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import DTypeLike, NDArray

from kinarm.envs.rendering import RENDER_MODES, EnvPictures
from kinarm.episode_draws import scenes_at
from kinarm.episodes import Episodes
from kinarm.errors import InvalidInputError, UnknownNameError, check_known, one_or_many
from kinarm.observation_part import UNIT, Ranges
from kinarm.plant import MOST_NOISE, RANGES
from kinarm.problem import ProblemLike, ReachProblem
from kinarm.scenarios import ScenarioQueues
from kinarm.simulator import Simulator, StepResult

Array = NDArray[np.float64]
Observations = Any
"""An array, or a dictionary of arrays; one row per arm."""

Outcome = tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]
"""Rewards, and which episodes terminated or were truncated, shape (n,) each."""

DTYPES = ("float64", "float32")


class UnexpectedArgumentError(InvalidInputError, TypeError):
    """An argument that environments do not have, which libraries try: TorchRL heeds TypeErrors."""


class Interface:
    """How an environment shows its simulator: its observation and reward.

    Spaces are those of one arm; observations are float64 or float32, actions fractions of the
    velocity limits. ``tells_terms`` says whether the reward sums up the problem's terms, which
    infos then hold.
    """

    observation_space: Space[Any]
    action_space: Space[Any]
    tells_terms = True

    def __init__(self, simulator: Simulator, dtype: DTypeLike = np.float64) -> None:
        try:
            name = np.dtype(dtype).name
        except TypeError:
            name = str(dtype)
        if name not in DTYPES:
            raise InvalidInputError(
                f"observation_dtype must be one of {list(DTYPES)}, got {dtype!r}"
            )
        self.simulator, self._dtype = simulator, np.dtype(name)
        self.action_space = Box(-1.0, 1.0, (simulator.n_actions,), dtype=np.float32)
        rate = round(1 / simulator.problem.stepping.time_step)
        self.metadata = {"render_modes": list(RENDER_MODES), "render_fps": max(rate, 1)}
        self.observation_space = self._space()

    def _space(self) -> Space[Any]:
        """Space of `observe` for one arm."""
        return bounded_space(state_bounds(self.simulator), self._dtype)

    def observe(self, observations: Array) -> Observations:
        """Show copies of the simulator's observations, shape (n, n_observations)."""
        return observations.astype(self._dtype)

    def step_outcome(self, episodes: Episodes, result: StepResult) -> Outcome:  # noqa: ARG002
        """Reward a step, and tell or change which episodes are over."""
        return result.reward, result.terminated, result.truncated


def one_by_one(observations: Observations, count: int) -> list[Any]:
    """Split a batch of shown observations into those of single arms."""
    if isinstance(observations, dict):
        return [{key: part[k] for key, part in observations.items()} for k in range(count)]
    return list(observations)


def state_bounds(simulator: Simulator) -> tuple[Array, Array]:
    """Bounds of an observation, with tolerances for goals, quaternions and measurements."""
    task, arm, plant = simulator.task, simulator.arm, simulator.problem.plant
    most = {name: plant.range_of(name)[1] for name in RANGES}
    noise, resolution = MOST_NOISE * most["noise"], most["resolution"]
    leap = resolution + most["calibration"]  # of a first command, which is within the limits
    off = noise + leap + most["bias"]
    missed = task.tolerance + most["goal_bias"] + MOST_NOISE * most["goal_noise"]
    goal_lower, goal_upper = simulator.world.goal_bounds
    ranges = Ranges(
        goal_lower=goal_lower - missed,
        goal_upper=goal_upper + missed,
        reach=arm.reach,
        lower=arm.lower - off,
        upper=arm.upper + off,
        fastest=UNIT + (2 * noise + leap) / simulator.step_limit,
    )
    return simulator.world.layout.bounds(ranges)


def bounded_space(bounds: tuple[Array, Array], dtype: np.dtype[Any]) -> Space[Any]:
    """Space of vectors of a type between two bounds, shape (n,) each."""
    lower, upper = (bound.astype(dtype) for bound in bounds)
    return Box(lower, upper, dtype=dtype.type)


class ArmEnvironment:
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
    interface_kind: type[Interface] = Interface
    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": 50}  # noqa: RUF012  (as Gymnasium declares it)
    _episodes: Episodes | None = None

    def _set_up(
        self,
        problem: ProblemLike,
        num_envs: int,
        threads: int | None,
        overrides: Mapping[str, Any],
        dtype: DTypeLike,
        render_mode: str | None,
        **picture: Any,
    ) -> None:
        """Build simulator and interface by the settings of `ReachEnv`."""
        try:
            changed = ReachProblem.load(problem).replace(**overrides)
        except UnknownNameError as error:
            if error.given not in overrides:
                raise
            raise UnexpectedArgumentError(
                f"unexpected keyword argument {error.given!r}: {error}"
            ) from error
        self.simulator = simulator = Simulator(changed, threads=threads)
        self.render_mode = render_mode
        self.interface = self.interface_kind(simulator, dtype)
        self.metadata = self.interface.metadata
        terms = simulator.task.reward.terms if self.interface.tells_terms else ()
        told = (*simulator.task.goal.told, *(f"reward_{name}" for name in terms))
        self._told = ("distance", *told)
        self._queues, self._n_arms = ScenarioQueues(simulator.world, num_envs), num_envs
        self._pictures = EnvPictures(simulator, render_mode, num_envs, **picture)

    def _begin(self, rows: NDArray[np.int64], options: Mapping[str, Any] | None = None) -> Episodes:
        """Begin episodes of some arms; options may set ``start`` and ``goal``."""
        if self._episodes is None:
            n_joints = self.simulator.arm.n_joints
            width = self.simulator.world.goal_width
            q, goals = np.zeros((self._n_arms, n_joints)), np.zeros((self._n_arms, width))
            goals[:, 3:4] = 1.0  # directions and quaternions have length 1
        else:
            q, goals = self._episodes.q, self._episodes.goal
        fixed = fixed_scenario(options, self.simulator, self._n_arms)
        if fixed:  # refuse what cannot be, before anything changes
            starts, ends = fixed.get("start", q)[rows], fixed.get("goal", goals)[rows]
            if "start" in fixed:
                self.simulator.reset(starts, ends)
            else:
                self.simulator.world.check_scenarios(starts, ends)
        self._queues.put(rows, q, goals)
        for array, name in ((q, "start"), (goals, "goal")):
            if name in fixed:
                array[rows] = fixed[name][rows]
        if self._episodes is None:
            self._episodes = self.simulator.reset(q, goals)
        else:
            self.simulator.begin(self._episodes, rows)
        self._pictures.begin(rows, self._episodes)
        return self._episodes

    def _find_contacts(self, episodes: Episodes, result: StepResult) -> None:
        """Fill in the numbers of contacts of a step that are not known yet."""
        contact, refused, world = result.contact, result.collision, self.simulator.world
        if np.count_nonzero(refused) == np.count_nonzero(contact):
            return
        rows = np.flatnonzero(refused & (contact == 0))
        ways = episodes.q[rows], episodes.target[rows], scenes_at(episodes.scenes, rows)
        for row, step in zip(rows, world.steps_of(*ways, episodes.steps[rows] - 1), strict=True):
            model, end = step.at(1.0)
            index = model.first_in_contact(end)
            if index is None:  # what touches on the way alone is looked for
                found = world.contact_of_step(step)
                contact[row] = self.contact_names.index(found.pair if found else None)
            else:
                contact[row] = 1 + index

    @property
    def episodes(self) -> Episodes:
        """The episodes, one row per arm; refused before a reset."""
        if self._episodes is None:
            raise InvalidInputError("the environment was never begun: call reset()")
        return self._episodes

    @property
    def configuration(self) -> Array:
        """A copy of the joint positions, shape (n, n_joints) [rad or m]."""
        return self.episodes.q.copy()

    @cached_property
    def contact_names(self) -> tuple[tuple[str, str] | None, ...]:
        """Names of the bodies of a contact, by its number; 0 is none."""
        return (None, *self.simulator.world.contact_model.pair_names)


def fixed_scenario(
    options: Mapping[str, Any] | None, simulator: Simulator, n: int
) -> dict[str, Array]:
    """What the options of a reset set, for n arms.

    Parameters
    ----------
    options : mapping, optional
        ``start``, shape (n_joints,) or (n, n_joints) [rad or m], and ``goal``,
        shape (goal_width,) or (n, goal_width) [m]: one for all arms, or one for
        each. In a scene with random bodies, both.
    simulator, n : Simulator and int
        Where, and the number of arms.

    Returns
    -------
    dict
        The same, one row an arm.
    """
    arm, fixed, wanted = simulator.arm, {}, options or {}
    widths = {"start": arm.n_joints, "goal": simulator.world.goal_width}
    if len(wanted) == 1 and simulator.world.has_random_bodies:
        raise InvalidInputError("start and goal decide where random bodies are: set both")
    check_known("reset option", wanted, widths)
    for name, value in wanted.items():
        array, one = one_or_many(name, value, (widths[name],))
        if not one and len(array) != n:
            raise InvalidInputError(
                f"{name} must have a row for each of {n} arms, got {len(array)}"
            )
        if name == "start":
            given = array[0] if one else array
            array = arm.chain.within_limits(name, given, arm.joint_names)
        fixed[name] = np.broadcast_to(array, (n, widths[name]))
    return fixed
