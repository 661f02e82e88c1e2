"""Outcome of one step of many episodes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.compiling import Array
from kinarm.task import ReachTask


class StepResult(NamedTuple):
    """Outcome of one step of n episodes, in tables that the kernel fills.

    Attributes
    ----------
    numbers : ndarray, shape (2 + n_told + n_terms, n)
        Rewards, distances to the goal [m], what goals have beside it
        (``GoalSpecification.told``), and weighted terms, as in
        ``RewardWeights.terms``. Rewards are zero for episodes that were
        over.
    flags : ndarray of bool, shape (3, n)
        Truncation, success and refusal by contact; false for episodes that go
        on or were over.
    contact : ndarray of int, shape (n,)
        Number, from 1, of the pair that refused the step; 0 if none or unknown.
    task : ReachTask
        The task.
    """

    numbers: Array
    flags: NDArray[np.bool_]
    contact: NDArray[np.int64]
    task: ReachTask

    @classmethod
    def empty(cls, n: int, task: ReachTask) -> "StepResult":
        """Empty tables for a task."""
        rows = 2 + len(task.goal.told) + len(task.reward.terms)
        return cls(np.empty((rows, n)), np.empty((3, n), bool), np.empty(n, np.int64), task)

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
        return self.numbers[-len(self.task.reward.terms) :].T

    @property
    def told(self) -> dict[str, Array]:
        """What goals have beside a distance, ``turn`` and ``goals_reached``, shape (n,) each."""
        return dict(zip(self.task.goal.told, self.numbers[2:], strict=False))

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
