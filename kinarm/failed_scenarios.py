"""Replay of failed scenarios: episodes of a training that begin where earlier ones failed.

A policy that reaches most goals meets few scenarios that it can still learn from. A training may
therefore draw a share of its scenarios from those of the last failed episodes. Its scenarios then
have another distribution than those of an evaluation, which never replays any.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm._fields import check_fields
from kinarm._validation import whole_number
from kinarm.errors import InvalidInputError

StartsAndGoals = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Starts, shape (n, n_joints) [rad or m], and goals, shape (n, 3) [m]."""

LARGEST_REPLAY = 1_000_000
"""Scenarios that can be kept."""


@dataclass(frozen=True, kw_only=True)
class Replay:
    """How failed scenarios are replayed.

    Parameters
    ----------
    share : float
        Probability that an episode replays a failed scenario, once there is one; 0 replays none.
    size : int
        Number of the last failures that are kept; see `FailedScenarios`.

    Raises
    ------
    InvalidInputError
        If the share is no probability, or the size not positive.
    """

    share: float = 0.5
    size: int = 8192

    def __post_init__(self) -> None:
        check_fields(self)
        if not 0 <= self.share <= 1:
            raise InvalidInputError(f"share must lie in [0, 1], got {self.share}")
        whole_number("size", self.size, 1, LARGEST_REPLAY)


class FailedScenarios(NamedTuple):
    """Scenarios of the last episodes that failed, the oldest first.

    A failure is kept for each episode, not for each scenario: one that failed k times among the
    last ``size`` failures is held k times, and all held ones are replayed with equal chance. So
    its chance is proportional to its recent failures, which needs no priorities that would have to
    be estimated, tuned and stored. Newer failures displace the oldest: a mastered scenario adds
    none, and is forgotten after ``size`` failures of others. Those that always fail are held more
    and more often, and can displace all others.

    Attributes
    ----------
    starts : ndarray, shape (n, n_joints)
        Configurations [rad or m].
    goals : ndarray, shape (n, 3)
        Goal positions [m].
    """

    starts: NDArray[np.float64]
    goals: NDArray[np.float64]

    def check(self) -> None:
        """Refuse starts and goals that are not as many.

        Raises
        ------
        InvalidInputError
            If they are not.
        """
        shapes = self.starts.shape, self.goals.shape
        if [len(shape) for shape in shapes] != [2, 2] or len(self.starts) != len(self.goals):
            raise InvalidInputError(f"failed scenarios have the shapes {shapes[0]}, {shapes[1]}")

    @classmethod
    def none(cls, n_joints: int) -> "FailedScenarios":
        """Before the first failure."""
        return cls(np.empty((0, n_joints)), np.empty((0, 3)))

    def followed_by(
        self, starts: NDArray[np.float64], goals: NDArray[np.float64], size: int
    ) -> "FailedScenarios":
        """Add newer ones, and forget the oldest.

        Parameters
        ----------
        starts : ndarray, shape (n, n_joints)
            Configurations [rad or m].
        goals : ndarray, shape (n, 3)
            Goal positions [m].
        size : int
            How many remain, the last ones.
        """
        parts = zip(self, (starts, goals), strict=True)
        return FailedScenarios(*(np.concatenate(pair)[-size:] for pair in parts))

    def mixed(
        self,
        share: float,
        rng: np.random.Generator,
        count: int,
        draw: Callable[[NDArray[np.int64]], StartsAndGoals],
    ) -> tuple[StartsAndGoals, NDArray[np.bool_]]:
        """Draw scenarios, a share of them from these.

        Parameters
        ----------
        share : float
            Probability that a scenario is one of these.
        rng : numpy.random.Generator
            Decides which of them. It is not asked if none can be.
        count : int
            How many.
        draw : callable
            Draws those that are new, given their places among all, in ascending order.

        Returns
        -------
        scenarios : tuple of ndarray
            Starts, shape (count, n_joints), and goals, shape (count, 3).
        replayed : ndarray of bool, shape (count,)
            Which are failed ones.
        """
        every = np.arange(count)
        if not share or not len(self.goals):
            return draw(every), np.zeros(count, dtype=bool)
        chance, choice = rng.random((2, count))
        replayed = chance < share
        picked = (choice * len(self.goals)).astype(np.int64)
        starts, goals = self.starts[picked], self.goals[picked]
        new = every[~replayed]
        if new.size:
            starts[new], goals[new] = draw(new)
        return (starts, goals), replayed
