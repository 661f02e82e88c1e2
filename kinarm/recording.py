"""Recordings: what an arm did in a trial or along a path, without pickle."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm._files import load_archive, reading, save_archive
from kinarm.episodes import Outcome, Rollouts
from kinarm.errors import (
    InvalidInputError,
    RecordingFileError,
    StartInContactError,
    finite_array,
    whole_number,
)
from kinarm.problem import ProblemLike, ReachProblem
from kinarm.simulator import Simulator
from kinarm.world import World

KIND, FORMAT_VERSION = "recording", 2
OUTCOMES = get_args(Outcome)
ARRAYS = ("states", "distances", "goal", "refused", "contact_point", "goals")
"""Array fields of a `Recording`."""

Replaced = tuple[tuple[int, tuple[str, str] | None], ...]
"""Steps that a shield replaced, and what would have touched, if that is known."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """The motion of an arm in one trial. Arrays are copied and read-only.

    Parameters
    ----------
    policy, problem
        Name of what drove the arm, and the problem, with its arm's hash.
    trial : int
        Number of the trial in its set.
    states : ndarray, shape (steps + 1, n_joints)
        Configurations, from the start to the end [rad or m].
    distances : ndarray, shape (steps + 1,)
        Distance from the tool to the goal at each of them [m].
    goal : ndarray, shape (goal_width,)
        First goal [m].
    outcome : str
        ``"success"``, ``"collision"`` or ``"truncated"``.
    contact, contact_point : tuple of str and ndarray, shape (3,), optional
        The two bodies that would have touched, and where [m], if the last move
        was refused.
    refused : ndarray, shape (n_joints,), optional
        Configuration of the refused move at which they touch first [rad or m].
    goals : ndarray, shape (steps + 1, goal_width), optional
        Goals at each configuration, if they move or follow each other.
    replaced : tuple, optional
        Steps that a shield replaced, from 0, each with the names of the two
        bodies that would have touched, or None if that is not known.
    steps_lower_bound : int, optional
        Proven: no motion reaches the goal in fewer steps.
    provenance : dict
        Where it comes from, for JSON.

    Raises
    ------
    InvalidInputError
        If shapes do not match, an entry is not finite or the outcome is
        unknown.
    """

    policy: str
    problem: ReachProblem
    trial: int
    states: NDArray[np.float64]
    distances: NDArray[np.float64]
    goal: NDArray[np.float64]
    outcome: str
    contact: tuple[str, str] | None = None
    contact_point: NDArray[np.float64] | None = None
    refused: NDArray[np.float64] | None = None
    goals: NDArray[np.float64] | None = None
    replaced: Replaced = ()
    steps_lower_bound: int | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.outcome not in OUTCOMES:
            raise InvalidInputError(f"outcome must be one of {OUTCOMES}, got {self.outcome!r}")
        object.__setattr__(self, "trial", whole_number("trial", self.trial, 0))
        states = finite_array("states", self.states, (None, None))
        horizon = self.problem.task.horizon
        if not 1 <= len(states) <= horizon + 1:
            raise InvalidInputError(
                f"states must be 1 to {horizon + 1} for a horizon of {horizon}, got {len(states)}"
            )
        width = self.problem.task.goal.width(states.shape[1])
        steps, joints = states.shape[:1], states.shape[1:]
        shapes = states.shape, steps, (width,), joints, (3,), (*steps, width)
        for name, shape in zip(ARRAYS, shapes, strict=True):
            value = getattr(self, name)
            if value is not None:
                value = finite_array(name, value, shape)
                value.flags.writeable = False
                object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        return (
            f"Recording({self.policy} in trial {self.trial} of {self.problem.name}: "
            f"{self.outcome} after {self.steps} steps)"
        )

    @property
    def steps(self) -> int:
        """Steps taken, a refused one included."""
        return len(self.states) - 1

    @property
    def final_distance(self) -> float:
        """Distance from the tool to the goal at the end [m]."""
        return float(self.distances[-1])

    def same_trial(self, other: "Recording") -> bool:
        """Whether another recording has the same start and goal."""
        same_goal = np.array_equal(self.goal, other.goal)
        return same_goal and np.array_equal(self.states[0], other.states[0])


def save_recordings(path: str | Path, recordings: Sequence[Recording]) -> None:
    """Write recordings to an ``.npz`` file.

    Raises
    ------
    OutputError
        If the file cannot be written; an existing one then stays as it was.
    """
    problems = list(dict.fromkeys(each.problem for each in recordings))
    entries, arrays = [], {}
    for number, each in enumerate(recordings):
        values = {**vars(each), "problem": problems.index(each.problem)}
        for name in ARRAYS:
            if (array := values.pop(name)) is not None:
                arrays[f"{name}_{number}"] = array
        entries.append(values)
    header = {"problems": [problem.to_json() for problem in problems], "recordings": entries}
    save_archive(path, KIND, FORMAT_VERSION, arrays, header, compress=True)


def load_recordings(path: str | Path) -> list[Recording]:
    """Read what `save_recordings` wrote.

    Raises
    ------
    RecordingFileError
        If the file is missing, damaged, something else, or of another version.
    """
    archive = load_archive(path, KIND, FORMAT_VERSION, RecordingFileError)
    with reading(repr(str(path)), KIND, RecordingFileError):
        problems = [ReachProblem.from_json(entries) for entries in archive.header["problems"]]
        recordings = []
        for number, entries in enumerate(archive.header["recordings"]):
            given = {**entries, "problem": problems[entries["problem"]]}
            given |= {name: archive.arrays.get(f"{name}_{number}") for name in ARRAYS}
            if given["contact"] is not None:
                given["contact"] = tuple(given["contact"])
            shielded = given.get("replaced", ())
            given["replaced"] = tuple((step, pair and tuple(pair)) for step, pair in shielded)
            recordings.append(Recording(**given))
        return recordings


def record_rollouts(
    simulator: Simulator,
    rollouts: Rollouts,
    policy: str,
    numbers: Sequence[int] | None = None,
    *,
    steps_lower_bound: Callable[[int], int | None] | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> list[Recording]:
    """Turn rollouts into recordings.

    Parameters
    ----------
    simulator, rollouts
        Simulator of the rollouts, which were made with ``record=True``.
    policy : str
        Name of what drove the arm.
    numbers : sequence of int, optional
        Which rollouts; all by default. It becomes the number of the trial.
    steps_lower_bound : callable, optional
        Gives the proven number of steps of a trial, or None.
    provenance : dict, optional
        Where they come from, for JSON.

    Raises
    ------
    InvalidInputError
        If the rollouts were made without ``record=True``, or lack a number.
    """
    if rollouts.paths.size == 0:
        raise InvalidInputError("these rollouts kept no configurations: make them with record=True")
    world, problem = simulator.world, simulator.problem.pinned
    recordings, outcomes = [], rollouts.outcomes
    for number in range(len(rollouts)) if numbers is None else numbers:
        if number not in range(len(rollouts)):
            raise InvalidInputError(f"no trial {number}: there are 0 to {len(rollouts) - 1}")
        states = rollouts.paths[number, : rollouts.steps[number] + 1]
        goal, goals = rollouts.goals[number], None
        if len(rollouts.goal_paths):
            goals = rollouts.goal_paths[number, : len(states)]
        aims = np.tile(goal, (len(states), 1)) if goals is None else goals
        touch = None
        if rollouts.collision[number]:
            there = world.in_scene(rollouts.starts[number], goal)
            refused = rollouts.configurations[number], rollouts.targets[number]
            touch = there.contact(*refused, step=len(states) - 2)
        recordings.append(
            Recording(
                policy=policy,
                problem=problem,
                trial=int(number),
                states=states,
                distances=world.distances(states, aims),
                goal=goal,
                goals=goals,
                outcome=outcomes[number],
                contact=touch.pair if touch else None,
                contact_point=touch.point if touch else None,
                refused=touch.configuration if touch else None,
                replaced=replaced_steps(world, rollouts.replaced, number),
                steps_lower_bound=steps_lower_bound(number) if steps_lower_bound else None,
                provenance=dict(provenance or {}),
            )
        )
    return recordings


def replaced_steps(world: World, replaced: NDArray[np.int64], number: int = 0) -> Replaced:
    """Which steps of an episode were replaced; see `kinarm.episodes.Episodes.replaced`."""
    numbers = replaced[number].tolist() if len(replaced) else []
    pairs = {0: None, -1: None, **dict(enumerate(world.contact_model.pair_names, start=1))}
    return tuple((step, pairs[pair]) for step, pair in enumerate(numbers) if pair)


def record_path(
    problem: ProblemLike | World,
    path: ArrayLike,
    *,
    goal: ArrayLike | None = None,
    name: str = "path",
) -> Recording:
    """Record what an arm does on a path.

    It moves straight to each next configuration, as fast as its joints allow
    and in at least a step. All joints move, whether actuated or not. A step
    that touches something is refused and is the last.

    Parameters
    ----------
    problem : World, ReachProblem, str or Path
        Arm, scene and time step; a short horizon is extended.
    path : array_like, shape (n, n_joints)
        One or more configurations within the limits [rad or m].
    goal : array_like, shape (goal_width,), optional
        Goal; what the tool reaches at the path's end by default [m].
    name : str
        What the recording calls its policy.

    Raises
    ------
    StartInContactError
        If the first configuration touches something.
    """
    world = problem if isinstance(problem, World) else World(problem)
    points = finite_array("path", path, (None, world.arm.n_joints))
    if len(points) == 0:
        raise InvalidInputError("path holds no configuration")
    points = world.arm.chain.within_limits("path", points, world.arm.joint_names)
    width = (world.goal_width,)
    aim = world.reached(points[-1:])[0] if goal is None else finite_array("goal", goal, width)
    world = world.in_scene(points[0], aim)
    if (pair := world.contact_pair(points[0])) is not None:
        raise StartInContactError(0, pair)
    states = _stepwise(world, points)
    contact = None
    for step, motion in enumerate(pairwise(states)):
        if (contact := world.contact(*motion, step=step)) is not None:
            states = np.concatenate([states[: step + 1], states[step : step + 1]])
            break
    reached = world.at_goals(world.reached(states[-1:])[0], aim)
    horizon = max(world.problem.task.horizon, len(states) - 1)
    return Recording(
        policy=name,
        problem=world.problem.replace(horizon=horizon).pinned,
        trial=0,
        states=states,
        distances=world.distances(states, np.tile(aim, (len(states), 1))),
        goal=aim,
        outcome="collision" if contact else "success" if reached else "truncated",
        contact=contact.pair if contact else None,
        contact_point=contact.point if contact else None,
        refused=contact.configuration if contact else None,
    )


def _stepwise(world: World, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Configurations at the ends of steps along a path, start included."""
    limit = world.arm.velocity_limits * world.problem.stepping.time_step
    parts = [points[:1]]
    for here, there in pairwise(points):
        steps = max(1, int(np.ceil((np.abs(there - here) / limit).max() - 1e-9)))
        shares = np.arange(1, steps + 1)[:, None] / steps
        parts.append(here + shares * (there - here))
        parts[-1][-1] = there
    return np.concatenate(parts)
