"""The outcome of a step, and of finished episodes."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.episodes import COLLISION, SUCCESS, Episodes


class StepResult(NamedTuple):
    """Outcome of one step of n episodes; arrays of shape (n,).

    Attributes
    ----------
    reward : ndarray
        Sum of the terms.
    terms : ndarray, shape (n, n_terms)
        The weighted terms, in the order of `kinarm.REWARD_TERMS`; zero for episodes that
        were over before.
    success, collision, truncated : ndarray of bool
        How the step ended; all false for episodes that go on or were over before.
    """

    reward: NDArray[np.float64]
    terms: NDArray[np.float64]
    success: NDArray[np.bool_]
    collision: NDArray[np.bool_]
    truncated: NDArray[np.bool_]

    @property
    def terminated(self) -> NDArray[np.bool_]:
        """Success or collision."""
        return self.success | self.collision


@dataclass(frozen=True, eq=False)
class Rollouts:
    """Finished episodes.

    Attributes
    ----------
    starts : ndarray, shape (n, n_joints)
        Start configurations [rad or m].
    goals : ndarray, shape (n, 3)
        Goal positions [m].
    success, collision : ndarray of bool, shape (n,)
        How the episodes ended; neither means that the horizon was reached.
    steps : ndarray of int, shape (n,)
        Steps taken.
    distance : ndarray, shape (n,)
        Final distance from the tool to the goal [m].
    returns : ndarray, shape (n,)
        Sums of rewards.
    configurations : ndarray, shape (n, n_joints)
        Final configurations [rad or m].
    targets : ndarray, shape (n, n_joints)
        Where the last step led; it differs from the final configuration if it was refused.
    moments : ndarray, shape (n, 2, n_observations), or empty
        Sums of the observations acted upon, less the given shift, and of their squares.
    paths : ndarray, shape (n, horizon + 1, n_joints), or empty
        Configurations visited, NaN after the end.
    """

    starts: NDArray[np.float64]
    goals: NDArray[np.float64]
    success: NDArray[np.bool_]
    collision: NDArray[np.bool_]
    steps: NDArray[np.int64]
    distance: NDArray[np.float64]
    returns: NDArray[np.float64]
    configurations: NDArray[np.float64]
    targets: NDArray[np.float64]
    moments: NDArray[np.float64]
    paths: NDArray[np.float64]

    @classmethod
    def from_episodes(cls, starts: NDArray[np.float64], episodes: Episodes) -> "Rollouts":
        """Collect the outcome of episodes that have ended; their arrays become read-only."""
        for array in (starts, *episodes):
            array.flags.writeable = False
        return cls(
            starts=starts,
            goals=episodes.goal,
            success=episodes.status == SUCCESS,
            collision=episodes.status == COLLISION,
            steps=episodes.steps,
            distance=episodes.distance,
            returns=episodes.total,
            configurations=episodes.q,
            targets=episodes.target,
            moments=episodes.moments,
            paths=episodes.path,
        )

    def __len__(self) -> int:
        return len(self.steps)

    def __repr__(self) -> str:
        reached, touched = int(self.success.sum()), int(self.collision.sum())
        return f"Rollouts({len(self)} episodes, {reached} successes, {touched} collisions)"
