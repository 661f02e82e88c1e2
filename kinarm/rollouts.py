"""The outcome of a step, and of finished episodes."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.episodes import COLLISION, SUCCESS, Episodes
from kinarm.kernels.compiling import Array
from kinarm.task import REWARD_TERMS

Outcome = Literal["success", "collision", "truncated"]
"""How an episode ends: at the goal, in contact, or at the horizon."""


class StepResult(NamedTuple):
    """Outcome of one step of n episodes, in three tables that the kernel fills in.

    Attributes
    ----------
    numbers : ndarray, shape (2 + n_terms, n)
        Rewards, distances from the tool to the goal [m], and the weighted terms, in the order of
        `kinarm.REWARD_TERMS`. Rewards are zero for episodes that were over before.
    flags : ndarray of bool, shape (3, n)
        Whether the horizon was reached, the goal, or the step was refused because something
        touches; all false for episodes that go on or were over before.
    contact : ndarray of int, shape (n,)
        Number, from 1, of the pair that refused the step; 0 if none did, or nobody looked.
    """

    numbers: Array
    flags: NDArray[np.bool_]
    contact: NDArray[np.int64]

    @classmethod
    def empty(cls, n: int) -> "StepResult":
        """Tables yet to be filled in."""
        rows = 2 + len(REWARD_TERMS)
        return cls(np.empty((rows, n)), np.empty((3, n), bool), np.empty(n, np.int64))

    @property
    def reward(self) -> Array:
        """Sums of the terms, shape (n,)."""
        return self.numbers[0, :]

    @property
    def distance(self) -> Array:
        """From the tool to the goal [m], shape (n,)."""
        return self.numbers[1, :]

    @property
    def terms(self) -> Array:
        """The weighted terms, shape (n, n_terms)."""
        return self.numbers[2:].T

    @property
    def truncated(self) -> NDArray[np.bool_]:
        """Whether the step ended an episode at the horizon, shape (n,)."""
        return self.flags[0, :]

    @property
    def success(self) -> NDArray[np.bool_]:
        """Whether it reached the goal, shape (n,)."""
        return self.flags[1, :]

    @property
    def collision(self) -> NDArray[np.bool_]:
        """Whether it was refused, shape (n,)."""
        return self.flags[2, :]

    @property
    def terminated(self) -> NDArray[np.bool_]:
        """Success or collision, shape (n,)."""
        return self.flags[1, :] | self.flags[2, :]


KEPT = {
    "goals": "goal",
    "steps": "steps",
    "distance": "distance",
    "returns": "total",
    "configurations": "q",
    "targets": "target",
    "moments": "moments",
    "paths": "path",
}
"""Arrays of `kinarm.episodes.Episodes` that are kept as they are, by their names in `Rollouts`."""


@dataclass(frozen=True, eq=False)
class Rollouts:
    """Finished episodes.

    Attributes
    ----------
    starts, goals : ndarray, shape (n, n_joints) and (n, 3)
        Start configurations [rad or m] and goal positions [m].
    success, collision : ndarray of bool, shape (n,)
        How the episodes ended; neither means that the horizon was reached.
    steps, distance, returns : ndarray, shape (n,)
        Steps taken, final distances from the tool to the goal [m], and sums of rewards.
    configurations, targets : ndarray, shape (n, n_joints)
        Final configurations, and where the last step led, which differs if it was refused.
    moments : ndarray, shape (n, 2, n_observations), or empty
        Sums of the observations acted upon, less the given shift, and of their squares.
    paths : ndarray, shape (n, horizon + 1, n_joints), or empty
        Configurations visited, NaN after the end.
    """

    starts: Array
    goals: Array
    success: NDArray[np.bool_]
    collision: NDArray[np.bool_]
    steps: NDArray[np.int64]
    distance: Array
    returns: Array
    configurations: Array
    targets: Array
    moments: Array
    paths: Array

    @classmethod
    def from_episodes(cls, starts: Array, episodes: Episodes, *, copy: bool = False) -> "Rollouts":
        """Collect the outcome of episodes that have ended; its arrays are read-only.

        Parameters
        ----------
        starts, episodes
            Where they started, shape (n, n_joints) [rad or m], and the episodes.
        copy : bool
            Copy their arrays, which may then serve others.
        """
        rollouts = cls(
            starts=starts,
            success=episodes.status == SUCCESS,
            collision=episodes.status == COLLISION,
            **{
                name: np.array(getattr(episodes, field), copy=copy or None)
                for name, field in KEPT.items()
            },
        )
        for array in vars(rollouts).values():
            array.flags.writeable = False
        return rollouts

    @property
    def outcomes(self) -> tuple[Outcome, ...]:
        """How each episode ended."""
        ends = np.select([self.success, self.collision], ["success", "collision"], "truncated")
        return tuple(ends.tolist())

    def __len__(self) -> int:
        return len(self.steps)

    def __repr__(self) -> str:
        reached, touched = int(self.success.sum()), int(self.collision.sum())
        return f"Rollouts({len(self)} episodes, {reached} successes, {touched} collisions)"
