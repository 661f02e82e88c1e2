"""Scenarios of many arms, which each have their own."""

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.compiling import kernel
from kinarm.scenarios import PREFETCHED, draw_scenarios
from kinarm.world import World

Array = NDArray[np.float64]
Rows = NDArray[np.int64]


@kernel
def deal(rows: Rows, taken: Rows, starts: Array, goals: Array, q: Array, goal: Array) -> int:
    """Copy the next scenario of each of some arms to its row of ``q`` and ``goal``.

    Parameters
    ----------
    rows : ndarray of int, shape (n,)
        The arms.
    taken : ndarray of int, shape (n_arms,)
        How many scenarios each arm was dealt.
    starts, goals : ndarray, shape (n_arms, n_drawn, n_joints) and (n_arms, n_drawn, 3)
        Scenarios, in their order.
    q, goal : ndarray, shape (n_arms, n_joints) and (n_arms, 3)
        Where to.

    Returns
    -------
    int
        -1; or an arm that has no scenario left, and then nothing is dealt.
    """
    for row in rows:
        if taken[row] == starts.shape[1]:
            return int(row)
    for row in rows:
        place = taken[row]
        taken[row] += 1
        for joint in range(q.shape[1]):
            q[row, joint] = starts[row, place, joint]
        for axis in range(3):
            goal[row, axis] = goals[row, place, axis]
    return -1


class ScenarioQueues:
    """Starts and goals of the successive episodes of many arms, drawn a few at a time.

    Those of an arm are what `kinarm.scenarios.ScenarioStream` gives with its generator.

    Parameters
    ----------
    world : World
        The world of the problem.
    rngs : list of numpy.random.Generator
        Source of randomness of each arm.
    """

    def __init__(self, world: World, rngs: list[np.random.Generator]) -> None:
        self._world, self._rngs = world, rngs
        self._starts = np.empty((len(rngs), PREFETCHED, world.arm.n_joints))
        self._goals = np.empty((len(rngs), PREFETCHED, 3))
        self._taken = np.full(len(rngs), PREFETCHED)

    def seed(self, row: int, rng: np.random.Generator) -> None:
        """Give an arm another generator, and forget what was drawn for it."""
        self._rngs[row], self._taken[row] = rng, PREFETCHED

    def put(self, rows: Rows, q: Array, goal: Array) -> None:
        """Put the next scenarios of some arms into their rows.

        Parameters
        ----------
        rows : ndarray of int, shape (n,)
            The arms.
        q, goal : ndarray, shape (n_arms, n_joints) and (n_arms, 3)
            Where to [rad or m].
        """
        while (row := deal(rows, self._taken, self._starts, self._goals, q, goal)) >= 0:
            drawn = draw_scenarios(self._world, self._rngs[row], PREFETCHED)
            self._starts[row], self._goals[row] = drawn
            self._taken[row] = 0
