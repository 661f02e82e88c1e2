"""Scenarios of many arms, which each have their own."""

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.compiling import kernel
from kinarm.scenarios import PREFETCHED, draw_for_each
from kinarm.world import World

Array = NDArray[np.float64]
Rows = NDArray[np.int64]


@kernel
def deal(
    rows: Rows, taken: Rows, drawn: Rows, starts: Array, goals: Array, q: Array, goal: Array
) -> bool:
    """Copy the next scenario of each of some arms to its row of ``q`` and ``goal``.

    Nothing is dealt, and the answer is no, where one of them has none left.

    Parameters
    ----------
    rows : ndarray of int, shape (n,)
        The arms.
    taken, drawn : ndarray of int, shape (n_arms,)
        How many scenarios each arm was dealt, and how many were drawn for it.
    starts, goals : ndarray, shape (n_arms, n_kept, n_joints) and (n_arms, n_kept, 3)
        Scenarios; the one of number k has the place k modulo n_kept.
    q, goal : ndarray, shape (n_arms, n_joints) and (n_arms, 3)
        Where to.
    """
    for row in rows:
        if taken[row] == drawn[row]:
            return False
    for row in rows:
        place = taken[row] % starts.shape[1]
        taken[row] += 1
        for joint in range(q.shape[1]):
            q[row, joint] = starts[row, place, joint]
        for axis in range(3):
            goal[row, axis] = goals[row, place, axis]
    return True


class ScenarioQueues:
    """Starts and goals of the successive episodes of many arms, drawn for all of them at a time.

    Those of an arm are what `kinarm.scenarios.draw_scenarios` draws with its generator, a few at a
    time. There is room for twice as many as are drawn: once an arm has none left, all that have
    room get some.
    """

    def __init__(self, world: World, n_arms: int) -> None:
        self._world, self._rngs = world, [np.random.default_rng() for _ in range(n_arms)]
        self._starts = np.empty((n_arms, 2 * PREFETCHED, world.arm.n_joints))
        self._goals = np.empty((n_arms, 2 * PREFETCHED, 3))
        self._taken, self._drawn = np.zeros((2, n_arms), dtype=np.int64)

    def seed(self, row: int, rng: np.random.Generator) -> None:
        """Give an arm another generator, and forget what was drawn for it."""
        self._rngs[row] = rng
        self._taken[row] = self._drawn[row] = 0

    def put(self, rows: Rows, q: Array, goal: Array) -> None:
        """Put the next scenarios of some arms into their rows of configurations and goals.

        Parameters
        ----------
        rows, q, goal
            As for `deal`.
        """
        queues = self._taken, self._drawn, self._starts, self._goals
        if not deal(rows, *queues, q, goal):
            self._draw()
            deal(rows, *queues, q, goal)

    def _draw(self) -> None:
        """Draw scenarios for all arms that have room for them."""
        rows = (self._drawn - self._taken <= PREFETCHED).nonzero()[0]
        rngs = [self._rngs[row] for row in rows.tolist()]
        places = (self._drawn[rows, None] + np.arange(PREFETCHED)) % (2 * PREFETCHED)
        drawn = draw_for_each(self._world, rngs, PREFETCHED)
        self._starts[rows[:, None], places], self._goals[rows[:, None], places] = drawn
        self._drawn[rows] += PREFETCHED
