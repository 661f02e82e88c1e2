"""Arrays that the simulator hands to the compiled kernels: rules, actions and episodes."""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from kinarm.contact_shapes import PLANE
from kinarm.kernels.records import Layout
from kinarm.observation import observation_size
from kinarm.task import REWARD_TERMS

RUNNING, PAUSED, SUCCESS, COLLISION, TRUNCATED = range(5)
"""States of an episode."""


LINEAR, TANH, RELU, HARDTANH, ELU, LEAKY_RELU, SILU = range(7)
"""Activation functions of networks."""


class Rules(NamedTuple):
    """Task and motion limits as the kernels need them.

    Attributes
    ----------
    step_limit : ndarray, shape (n_actuated,)
        Largest move of each joint in a step [rad or m].
    tested : int
        Configurations at which the motion of a step is tested for contact.
    tolerance : float
        The goal counts as reached at this distance or less [m].
    horizon : int
        Steps after which an episode is truncated.
    reward : ndarray, shape (n_terms,)
        Weights of the reward terms.
    """

    step_limit: NDArray[np.float64]
    tested: int
    tolerance: float
    horizon: int
    reward: NDArray[np.float64]


class Control(NamedTuple):
    """Where actions come from: dense networks, or a table if ``layers`` is empty.

    Attributes
    ----------
    layers : ndarray of int, shape (n_layers + 1,)
        Widths, from the observation to the action.
    weights : ndarray, shape (n_policies, n_parameters)
        Layer after layer, the weights (inputs x outputs) and then the bias.
    policy : ndarray of int, shape (n_episodes,)
        Which row of ``weights`` an episode uses.
    activations : ndarray of int, shape (n_layers,)
        Function after each layer; the last one's values are then clipped.
    observation_signs, action_signs : ndarray, shape (n_observations,) and (n_actuated,), or (0,)
        The reflection by which the networks see goals on the left, if they do.
    side : int
        Entry of the observation that is positive where the goal lies on the left.
    actions : ndarray, shape (n_episodes, n_steps, n_actuated)
        The table; a table of one step serves every step.
    """

    layers: NDArray[np.int64]
    weights: NDArray[np.float64]
    policy: NDArray[np.int64]
    activations: NDArray[np.int64]
    observation_signs: NDArray[np.float64]
    action_signs: NDArray[np.float64]
    side: int
    actions: NDArray[np.float64]


class Episodes(NamedTuple):
    """State of n episodes; the kernels change it in place.

    Attributes
    ----------
    status : ndarray of int, shape (n,)
        `RUNNING`, `PAUSED`, `SUCCESS`, `COLLISION` or `TRUNCATED`.
    steps : ndarray of int, shape (n,)
        Steps taken.
    stop : ndarray of int, shape (n,)
        Step count at which to hand an episode back.
    q : ndarray, shape (n, n_joints)
        Configuration [rad or m].
    target : ndarray, shape (n, n_joints)
        Where the step under way leads.
    doubt : ndarray of int, shape (n,)
        Bit k - 1 set: configuration k of the step under way is not proven free.
    touched : ndarray of int, shape (n,)
        Number, from 1, of the pair that refused the last step; 0 if none did, or nobody looked.
    cleared : ndarray of bool, shape (n,)
        Coal has found the step under way free.
    planes : ndarray, shape (n, n_pairs, PLANE)
        Separating plane of each pair and the height above it at ``q``; see
        ``kinarm.kernels.planes``.
    goal : ndarray, shape (n, 3)
        Goal position [m].
    observation : ndarray, shape (n, n_observations)
        Observation of the current state.
    distance : ndarray, shape (n,)
        From the tool to the goal [m].
    terms : ndarray, shape (n, n_terms)
        Weighted terms of the last reward.
    total : ndarray, shape (n,)
        Return: sum of rewards.
    moments : ndarray, shape (n, 2, n_observations) or (0, 2, n_observations)
        Sums of the observations acted upon, less ``shift``, and of their squares.
    shift : ndarray, shape (n_observations,)
        Subtracted before summing, for accuracy.
    path : ndarray, shape (n, horizon + 1, n_joints) or (0, 0, n_joints)
        Configurations visited.
    """

    status: NDArray[np.int64]
    steps: NDArray[np.int64]
    stop: NDArray[np.int64]
    q: NDArray[np.float64]
    target: NDArray[np.float64]
    doubt: NDArray[np.int64]
    touched: NDArray[np.int64]
    cleared: NDArray[np.bool_]
    planes: NDArray[np.float64]
    goal: NDArray[np.float64]
    observation: NDArray[np.float64]
    distance: NDArray[np.float64]
    terms: NDArray[np.float64]
    total: NDArray[np.float64]
    moments: NDArray[np.float64]
    shift: NDArray[np.float64]
    path: NDArray[np.float64]

    @classmethod
    def allocate(
        cls,
        starts: NDArray[np.float64],
        goals: NDArray[np.float64],
        *,
        n_pairs: int,
        horizon: int,
        record: bool = False,
        shift: NDArray[np.float64] | None = None,
    ) -> "tuple[Episodes, Any]":
        """Allocate episodes at their starts, and their record for the kernels, in one buffer.

        The kernel ``begin`` fills in the rest.

        Parameters
        ----------
        starts, goals : ndarray, shape (n, n_joints) and (n, 3)
            Configurations [rad or m] and goal positions [m].
        n_pairs, horizon : int
            Pairs that are tested for contact, and steps to go.
        record : bool
            Keep the configurations visited.
        shift : ndarray, shape (n_observations,), optional
            Collect sums of the observations about this point.
        """
        n, n_joints = starts.shape
        layout = episodes_layout(n, n_joints, n_pairs, horizon if record else 0, shift is not None)
        known = layout.record_of(cls)
        episodes: Episodes = known.values
        episodes.stop[:] = horizon
        episodes.q[:], episodes.target[:], episodes.goal[:] = starts, starts, goals
        episodes.path[:] = np.nan
        if shift is not None:
            episodes.shift[:] = shift
        return episodes, known

    def resume(self, rows: NDArray[np.int64], horizon: int) -> None:
        """Let episodes go on that success or contact ended; at the horizon they are truncated."""
        over = self.steps[rows] >= horizon
        self.status[rows] = np.where(over, TRUNCATED, RUNNING)


@lru_cache(maxsize=64)
def episodes_layout(n: int, n_joints: int, n_pairs: int, horizon: int, collects: bool) -> Layout:
    """How `Episodes` lie in memory.

    Parameters
    ----------
    n, n_joints, n_pairs : int
        Numbers of episodes, joints and tested pairs.
    horizon : int
        Steps of which configurations are kept; 0 for none.
    collects : bool
        Whether moments of observations are collected.
    """
    n_observations = observation_size(n_joints)
    path = (n, horizon + 1, n_joints) if horizon else (0, 0, n_joints)
    shapes: dict[str, tuple[types.Type, tuple[int, ...]]] = {
        **dict.fromkeys(("status", "steps", "stop"), (types.int64, (n,))),
        **dict.fromkeys(("q", "target"), (types.float64, (n, n_joints))),
        **dict.fromkeys(("doubt", "touched"), (types.int64, (n,))),
        "cleared": (types.boolean, (n,)),
        "planes": (types.float64, (n, n_pairs, PLANE)),
        "goal": (types.float64, (n, 3)),
        "observation": (types.float64, (n, n_observations)),
        "distance": (types.float64, (n,)),
        "terms": (types.float64, (n, len(REWARD_TERMS))),
        "total": (types.float64, (n,)),
        "moments": (types.float64, (n if collects else 0, 2, n_observations)),
        "shift": (types.float64, (n_observations,)),
        "path": (types.float64, path),
    }
    return Layout("Episodes", shapes)
