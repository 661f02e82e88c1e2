"""Motions as tables of actions: straight, by way of a point, and along a path."""

import numpy as np
from numpy.typing import NDArray

from kinarm.simulator import Simulator


def steps_between(
    simulator: Simulator, first: NDArray[np.float64], second: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Steps that the straight motion between configurations takes, before rounding up.

    The slowest joint decides: the largest of |dq_i| / (rate_i dt) over the actuated joints.

    Parameters
    ----------
    simulator : Simulator
        The arm and its step.
    first, second : ndarray, shape (..., n_joints)
        The configurations [rad or m].
    """
    moved = np.abs(second - first)[..., : simulator.n_actions] / simulator.step_limit
    steps: NDArray[np.float64] = moved.max(axis=-1)
    return steps


def two_segments(
    simulator: Simulator,
    starts: NDArray[np.float64],
    vias: NDArray[np.float64],
    ends: NDArray[np.float64],
    turn: NDArray[np.int64],
    steps: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Actions that move straight to one configuration, then straight to another, then rest.

    ``vias`` are reached after ``turn`` steps, ``ends`` after ``steps``; where these are equal, the
    ends are not visited. Shape (m, horizon, n_actions).

    Parameters
    ----------
    simulator : Simulator
        The arm, its step and the horizon.
    starts, vias, ends : ndarray, shape (m, n_joints)
        Where the motions begin, turn and end [rad or m].
    turn, steps : ndarray of int, shape (m,)
        Steps to the turn, and to the end.
    """
    moved = slice(simulator.n_actions)
    after = np.maximum(steps - turn, 1)
    first = (vias - starts)[:, moved] / (turn[:, None] * simulator.step_limit)
    second = (ends - vias)[:, moved] / (after[:, None] * simulator.step_limit)
    step = np.arange(simulator.task.horizon)[None, :, None]
    turning, ending = turn[:, None, None], steps[:, None, None]
    actions: NDArray[np.float64] = np.where(
        step < turning, first[:, None], np.where(step < ending, second[:, None], 0.0)
    )
    return actions


def straight(
    simulator: Simulator,
    starts: NDArray[np.float64],
    ends: NDArray[np.float64],
    steps: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Actions that move straight to a configuration, then rest; see `two_segments`.

    Parameters
    ----------
    simulator, starts, ends, steps
        As for `two_segments`.
    """
    return two_segments(simulator, starts, ends, ends, steps, steps)


def along_path(
    simulator: Simulator, path: NDArray[np.float64], *, through_corners: bool
) -> NDArray[np.float64] | None:
    """Actions that follow a path of straight segments at full speed, then rest.

    A step ends at every configuration if the path is followed ``through_corners``; else steps cut
    corners, and are fewer. Shape (horizon, n_actions); None if the horizon is too short.

    Parameters
    ----------
    simulator : Simulator
        The arm, its step and the horizon.
    path : ndarray, shape (m, n_joints)
        Configurations, connected by straight segments [rad or m].
    through_corners : bool
        Whether every one of them is visited.
    """
    lengths = steps_between(simulator, path[:-1], path[1:])
    if through_corners:
        lengths = np.ceil(lengths - 1e-9)
    arrival = np.concatenate([[0.0], np.cumsum(lengths)])
    n_steps = int(np.ceil(arrival[-1] - 1e-9))
    if n_steps > simulator.task.horizon:
        return None
    times = np.minimum(np.arange(n_steps + 1), arrival[-1])
    visited = np.stack(
        [np.interp(times, arrival, path[:, axis]) for axis in range(simulator.n_actions)], axis=1
    )
    actions = np.zeros((simulator.task.horizon, simulator.n_actions))
    actions[:n_steps] = np.diff(visited, axis=0) / simulator.step_limit
    return actions
