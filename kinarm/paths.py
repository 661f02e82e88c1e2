"""Own paths: the arm moved along configurations, as a recording."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm._validation import finite_array
from kinarm.errors import InvalidInputError, StartInContactError
from kinarm.problem import ProblemLike
from kinarm.recording import Recording
from kinarm.world import World


def record_path(
    problem: ProblemLike | World,
    path: ArrayLike,
    *,
    goal: ArrayLike | None = None,
    name: str = "path",
) -> Recording:
    """Record what an arm does that is to follow a path.

    From each configuration it moves straight to the next one, as fast as its joints allow and in
    at least a step. All joints move, whether or not actions move them. The motion is tested for
    contact as in the simulator; a step that touches something is refused and the last one.

    Parameters
    ----------
    problem : World, ReachProblem, str or Path
        Arm, scene and time step; a horizon that is too short for the path is made longer.
    path : array_like, shape (n, n_joints)
        At least one configuration, all within the limits [rad or m].
    goal : array_like, shape (3,), optional
        Goal position, the tool point at the end of the path by default [m].
    name : str
        How the recording calls what drove the arm.

    Raises
    ------
    StartInContactError
        If the first configuration touches something.
    """
    world = problem if isinstance(problem, World) else World(problem)
    points = _within_limits(world, path)
    if (pair := world.contact_pair(points[0])) is not None:
        raise StartInContactError(0, pair)
    aim = world.poses(points[-1])[:3, 3] if goal is None else finite_array("goal", goal, (3,))
    states = _stepwise(world, points)
    tested = world.substeps(states[:-1], states[1:])
    touching = world.in_contact(tested.reshape(-1, world.arm.n_joints)).reshape(tested.shape[:2])
    contact = None
    if touching.any():
        step = int(touching.any(axis=1).argmax())
        contact = world.contact(tested[step, touching[step].argmax()])
        states = np.concatenate([states[: step + 1], states[step : step + 1]])
    distances = world.distances(states, np.tile(aim, (len(states), 1)))
    reached = bool(distances[-1] <= world.problem.task.tolerance)
    horizon = max(world.problem.task.horizon, len(states) - 1)
    return Recording(
        policy=name,
        problem=world.problem.replace(horizon=horizon).pinned,
        trial=0,
        states=states,
        distances=distances,
        goal=aim,
        outcome="collision" if contact else "success" if reached else "truncated",
        contact=contact.pair if contact else None,
        contact_point=contact.point if contact else None,
        refused=contact.configuration if contact else None,
    )


def _within_limits(world: World, path: ArrayLike) -> NDArray[np.float64]:
    """Check the configurations of a path."""
    points = finite_array("path", path, (None, world.arm.n_joints))
    if len(points) == 0:
        raise InvalidInputError("path holds no configuration")
    outside = (points < world.arm.lower) | (points > world.arm.upper)
    if outside.any():
        row, joint = np.argwhere(outside)[0]
        raise InvalidInputError(
            f"configuration {row} of the path lies outside the limits: "
            f"{world.arm.joint_names[joint]} at {points[row, joint]:.6g}, "
            f"{world.arm.lower[joint]:.6g} to {world.arm.upper[joint]:.6g} allowed"
        )
    return points


def _stepwise(world: World, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Configurations at the ends of all steps along a path, its start included."""
    limit = world.arm.velocity_limits * world.problem.stepping.time_step
    parts = [points[:1]]
    for here, there in pairwise(points):
        steps = max(1, int(np.ceil((np.abs(there - here) / limit).max() - 1e-9)))
        shares = np.arange(1, steps + 1)[:, None] / steps
        parts.append(here + shares * (there - here))
        parts[-1][-1] = there
    return np.concatenate(parts)
