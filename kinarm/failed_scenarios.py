"""Replay of failed scenarios: training episodes that begin where earlier ones failed.

A policy that reaches most goals meets few scenarios to learn from. A training may therefore draw a
share of them from the last failures; evaluations never do.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

StartsAndGoals = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Starts, shape (n, n_joints) [rad or m], and goals, shape (n, goal_width) [m]."""

LARGEST_REPLAY = 1_000_000
"""Largest number of kept scenarios."""


class FailedScenarios(NamedTuple):
    """Scenarios of the last episodes that failed, oldest first.

    One that failed k times among the last ``size`` failures is held k times,
    and all are replayed with equal chance. A mastered one is forgotten after
    ``size`` failures of others. Those that always fail can displace all others.

    Attributes
    ----------
    starts : ndarray, shape (n, n_joints)
        Configurations [rad or m].
    goals : ndarray, shape (n, goal_width)
        Goals [m].
    """

    starts: NDArray[np.float64]
    goals: NDArray[np.float64]

    @classmethod
    def none(cls, n_joints: int, goal_width: int = 3) -> "FailedScenarios":
        """Before the first failure."""
        return cls(np.empty((0, n_joints)), np.empty((0, goal_width)))

    def followed_by(
        self, starts: NDArray[np.float64], goals: NDArray[np.float64], size: int
    ) -> "FailedScenarios":
        """Add newer ones, and keep the last ``size``.

        Parameters
        ----------
        starts, goals, size
            As in `FailedScenarios`, and how many remain.
        """
        parts = zip(self, (starts, goals), strict=True)
        return FailedScenarios(*(np.concatenate(pair)[-size:] for pair in parts))

    def mixed(
        self,
        share: float,
        rng: np.random.Generator,
        count: int,
        draw: Callable[[int], StartsAndGoals],
    ) -> tuple[StartsAndGoals, NDArray[np.bool_]]:
        """Draw scenarios, a share of them from these.

        Parameters
        ----------
        share, count : float and int
            Probability that a scenario is one of these, and number to draw.
        rng : numpy.random.Generator
            Decides which of them; not asked if none can be.
        draw : callable
            Draws so many new ones.

        Returns
        -------
        tuple
            Starts and goals, and which failed before, an array of bool of shape
            (count,).
        """
        if not share or not len(self.goals):
            return draw(count), np.zeros(count, dtype=bool)
        chance, choice = rng.random((2, count))
        replayed = chance < share
        picked = (choice * len(self.goals)).astype(np.int64)
        starts, goals = self.starts[picked], self.goals[picked]
        if not replayed.all():
            starts[~replayed], goals[~replayed] = draw(int(np.count_nonzero(~replayed)))
        return (starts, goals), replayed
