"""Proven bounds of steps and distances for batches of trials."""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from kinarm._parallel import run_rows
from kinarm.chain import MotionBounds
from kinarm.kernels.compiling import Array
from kinarm.kernels.records import recorded
from kinarm.policies.oracle.kernels.approach import WAITING, Boxes, layout, search
from kinarm.simulator import Simulator

BUDGET = 100_000
"""Boxes that a proof may examine per number of steps."""

RESOLUTION = 1e-3
"""How far a proven distance may be below the smallest one [m]."""


class Prover:
    """Proves bounds for the arm and scene of a simulator.

    Starts have the shape (n, n_joints) [rad or m], goals (n, 3) [m]. With ``contact``, what is
    proven to touch something does not count. A `search` may examine ``budget`` boxes.
    """

    def __init__(self, simulator: Simulator) -> None:
        chain, shapes, _ = simulator.world.records
        bounds = MotionBounds.of(simulator.arm.chain, simulator.n_actions)
        self._simulator = simulator
        self._search = partial(search, chain, recorded(bounds), shapes)

    def bound_steps(
        self,
        starts: Array,
        goals: Array,
        witnesses: Array,
        rows: NDArray[np.int64],
        fewest: NDArray[np.int64],
        most: NDArray[np.int64],
        *,
        contact: bool = False,
        budget: int = BUDGET,
    ) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Prove how many steps it takes at least to reach goals.

        Returned are lower bounds for the ``rows``, and whether a configuration
        that counts attains them, or none reaches the goal in ``most``.

        Parameters
        ----------
        starts, goals, contact, budget
            See `Prover`.
        witnesses : ndarray, shape (n, n_joints)
            Filled with configurations that attain the bounds [rad or m].
        rows, fewest, most : ndarray of int, shape (n_rows,)
            The trials, and the range of steps; fewer are impossible.
        """
        simulator, n = self._simulator, len(rows)
        lower_bounds, tight = np.empty(n, dtype=np.int64), np.empty(n, dtype=bool)

        def bound_some(first: int, last: int) -> None:
            limits, space = simulator.step_limit.copy(), self._space()
            best, (lower, upper) = np.empty(starts.shape[1]), np.empty((2, len(limits)))
            tolerance = simulator.task.tolerance
            for i in range(first, last):
                start, goal = starts[rows[i]].copy(), (*goals[rows[i]].tolist(),)
                few, many, all_at_once = int(fewest[i]), int(most[i]), not contact
                lower_bounds[i], tight[i] = few, True
                while few <= many:
                    limit = many if all_at_once else few
                    inputs = (limits, few, limit, tolerance, np.inf, contact, budget, lower, upper)
                    complete, steps, _, _ = self._search(start, goal, *inputs, best, *space)
                    if steps <= limit:
                        witnesses[rows[i]] = best
                    if complete:
                        few = steps
                    lower_bounds[i], tight[i] = few, complete
                    if steps <= limit if complete else not all_at_once:
                        break
                    # All at once is least work, unless the budget is too small, or contact counts:
                    # then each number of steps has its own, up to those found.
                    if all_at_once:
                        many, all_at_once = steps - 1, False

        run_rows(bound_some, n, BUDGET * n, simulator.threads)
        return lower_bounds, tight

    def bound_distance(
        self,
        starts: Array,
        goals: Array,
        box: tuple[Array, Array],
        *,
        resolution: float = RESOLUTION,
        budget: int = BUDGET,
    ) -> tuple[Array, Array]:
        """Bound how close the tool can come to goals, whatever it touches.

        Returned are distances proven and found, shape (n, 2) [m], and
        configurations.

        Parameters
        ----------
        starts, goals, budget
            See `Prover`; joints that are not actuated stay.
        box : tuple of ndarray, shape (n, n_actions)
            Lower and upper corners of where the others can be [rad or m].
        resolution : float
            How far a proven distance may be below the smallest one [m].
        """
        n, n_moved = len(starts), self._simulator.n_actions
        distances, configurations = np.empty((n, 2)), np.empty(starts.shape)

        def bound_some(first: int, last: int) -> None:
            unlimited, space = np.full(n_moved, np.inf), self._space()
            inputs = (unlimited, n_moved, n_moved, 0.0, resolution, False, budget)
            for row in range(first, last):
                start, goal = starts[row].copy(), (*goals[row].tolist(),)
                corners = (box[0][row].copy(), box[1][row].copy(), configurations[row])
                _, _, found, proven = self._search(start, goal, *inputs, *corners, *space)
                distances[row] = proven, found

        run_rows(bound_some, n, BUDGET * n, self._simulator.threads)
        return distances, configurations

    def _space(self) -> tuple[Array, Boxes]:
        """Space for boxes that wait and boxes that are examined."""
        n, n_joints = self._simulator.n_actions, self._simulator.arm.n_joints
        n_placed = len(self._simulator.world.contact_model.shapes.placed)
        return np.empty((WAITING, 2 * n + 1)), layout(n, n_joints, n_placed).record()
