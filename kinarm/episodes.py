"""Arrays that the simulator hands to the compiled kernels: rules, actions and episodes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.contact_shapes import PLANE
from kinarm.kernels.compiling import Array
from kinarm.observation import GOAL_SIDE, observation_size
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
    tolerance, horizon
        Distance at which a goal counts as reached [m], and steps after which episodes end.
    reward : ndarray, shape (n_terms,)
        Weights of the reward terms.
    """

    step_limit: Array
    tested: int
    tolerance: float
    horizon: int
    reward: Array


class Control(NamedTuple):
    """Where actions come from: dense networks, or a table if ``layers`` is empty, as by default.

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

    layers: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
    weights: Array = np.zeros((0, 0))
    policy: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
    activations: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
    observation_signs: Array = np.zeros(0)
    action_signs: Array = np.zeros(0)
    side: int = GOAL_SIDE
    actions: Array = np.zeros((0, 0, 0))


class Episodes(NamedTuple):
    """State of n episodes; the kernels change it in place.

    Attributes
    ----------
    status, steps, stop : ndarray of int, shape (n,)
        `RUNNING`, `PAUSED`, `SUCCESS`, `COLLISION` or `TRUNCATED`; steps taken; step count at which
        to hand an episode back.
    q, target : ndarray, shape (n, n_joints)
        Configuration, and where the step under way leads [rad or m].
    doubt : ndarray of int, shape (n,)
        Bit k - 1 set: configuration k of the step under way is not proven free.
    touched : ndarray of int, shape (n,)
        Number, from 1, of the pair that refused the last step; 0 if none did, or nobody looked.
    cleared : ndarray of bool, shape (n,)
        Coal has found the step under way free.
    planes : ndarray, shape (n, n_pairs, PLANE)
        Separating plane of each pair and the height above it at ``q``; see
        ``kinarm.kernels.planes``.
    goal, distance : ndarray, shape (n, 3) and (n,)
        Goal position, and distance of the tool from it [m].
    observation : ndarray, shape (n, n_observations)
        Observation of the current state.
    terms, total : ndarray, shape (n, n_terms) and (n,)
        Weighted terms of the last reward, and return: sum of rewards.
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
    q: Array
    target: Array
    doubt: NDArray[np.int64]
    touched: NDArray[np.int64]
    cleared: NDArray[np.bool_]
    planes: Array
    goal: Array
    observation: Array
    distance: Array
    terms: Array
    total: Array
    moments: Array
    shift: Array
    path: Array

    @classmethod
    def allocate(
        cls,
        starts: Array,
        goals: Array,
        *,
        n_pairs: int,
        horizon: int,
        record: bool = False,
        shift: Array | None = None,
    ) -> "Episodes":
        """Allocate episodes at their starts; the kernel ``begin`` fills in the rest.

        Parameters
        ----------
        starts, goals : ndarray, shape (n, n_joints) and (n, 3)
            Configurations [rad or m] and goal positions [m].
        n_pairs, horizon, record
            Pairs that are tested for contact, steps to go, and whether configurations are kept.
        shift : ndarray, shape (n_observations,), optional
            Collect sums of the observations about this point.
        """
        n, n_joints = starts.shape
        n_observations = observation_size(n_joints)
        return cls(
            status=np.zeros(n, dtype=np.int64),
            steps=np.zeros(n, dtype=np.int64),
            stop=np.full(n, horizon),
            q=starts.copy(),
            target=starts.copy(),
            doubt=np.zeros(n, dtype=np.int64),
            touched=np.zeros(n, dtype=np.int64),
            cleared=np.zeros(n, dtype=bool),
            planes=np.zeros((n, n_pairs, PLANE)),
            goal=goals.copy(),
            observation=np.zeros((n, n_observations)),
            distance=np.zeros(n),
            terms=np.zeros((n, len(REWARD_TERMS))),
            total=np.zeros(n),
            moments=np.zeros((0 if shift is None else n, 2, n_observations)),
            shift=np.zeros(n_observations) if shift is None else shift.copy(),
            path=np.full((n, horizon + 1, n_joints) if record else (0, 0, n_joints), np.nan),
        )

    def resume(self, rows: NDArray[np.int64], horizon: int) -> None:
        """Let episodes go on that success or contact ended; at the horizon they are truncated."""
        over = self.steps[rows] >= horizon
        self.status[rows] = np.where(over, TRUNCATED, RUNNING)
