"""Proven bounds of steps for batches of trials."""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from kinarm._parallel import run_rows
from kinarm.chain import MotionBounds
from kinarm.kernels.compiling import Array
from kinarm.kernels.goals import CONFIGURATION, DIRECTION, POSE, errors_between
from kinarm.kernels.records import recorded
from kinarm.policies.oracle.goals import Aims, Stage
from kinarm.policies.oracle.kernels.approach import ROUNDING, WAITING, layout, search
from kinarm.simulator import Simulator

BUDGET = 100_000
"""Boxes that a proof may examine per number of steps."""

SMALLEST = 1e-6
"""Share of a step, and move in one, that count as rounding [rad]."""


class Prover:
    """Proves bounds for the arm and scene of a simulator.

    Starts have the shape (n, n_joints) [rad or m]. Goals have the shape (n, goal_width), or (n,
    horizon + 1, goal_width) if they move. With ``contact``, what is proven to touch something does
    not count. A `search` may examine ``budget`` boxes.
    """

    def __init__(self, simulator: Simulator) -> None:
        chain, shapes, _ = simulator.world.records
        bounds = MotionBounds.of(simulator.arm.chain, simulator.n_actions)
        self._simulator, self._bounds = simulator, bounds
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
        n_times = goals.shape[1] if goals.ndim == 3 else 1
        asked = goals[rows].reshape(n * n_times, goals.shape[-1])
        aims = Aims.of(simulator, np.repeat(starts[rows], n_times, axis=0), asked, ROUNDING)

        def bound_some(first: int, last: int) -> None:
            limits, tolerance = simulator.step_limit.copy(), simulator.task.tolerance
            best, (lower, upper) = np.empty(starts.shape[1]), np.empty((2, len(limits)))
            placed, axes = len(simulator.world.contact_model.shapes.placed), len(aims.turn.axes)
            boxes = layout(len(limits), starts.shape[1], placed, axes).record()
            space = np.empty((WAITING, 2 * len(limits))), boxes
            for i in range(first, last):
                start, few, many = starts[rows[i]].copy(), int(fewest[i]), int(most[i])
                all_at_once = not contact and n_times == 1
                lower_bounds[i], tight[i] = few, True
                while few <= many:
                    limit = many if all_at_once else few
                    goal, turn, allowed = aims.of_row(i * n_times + min(few, n_times - 1))
                    inputs = (start, goal, turn, allowed, limits, few, limit, tolerance)
                    complete, steps = self._search(
                        *inputs, contact, budget, lower, upper, best, *space
                    )
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

    def steps_apart(self, before: Stage, after: Stage) -> NDArray[np.int64]:
        """Fewest steps from anywhere at goals to others, shape (n,): at least one.

        All joints move the tool as fast as they can, or turn it, or each joint
        moves by itself to its place in a configuration.
        """
        simulator, world = self._simulator, self._simulator.world
        kind, turn = world.rules.goal.kind, 2.0 * world.rules.goal.tolerance
        limits, n = simulator.step_limit, simulator.n_actions
        revolute = ~simulator.arm.chain.prismatic[:n]
        if before.walks is not None:
            return np.ones(len(after.goals), dtype=np.int64)
        distances, turns = np.empty((2, len(after.goals)))
        errors_between(kind, before.goals, after.goals, distances, turns)
        speeds = np.where(revolute, np.diag(self._bounds.curvature), 1.0)
        steps = (distances - 2.0 * world.rules.tolerance) / (speeds * limits).sum()
        if kind in (DIRECTION, POSE):
            fastest = max(float(limits[revolute].sum()), SMALLEST)
            steps = np.fmax(steps, (turns - turn) / fastest)
        elif kind == CONFIGURATION:
            moved = np.abs(after.goals - before.goals)[:, 3 : 3 + n]
            steps = np.fmax(steps, ((moved - turn) / limits).max(axis=1))
        steps = np.clip(steps - SMALLEST, 1.0, simulator.task.horizon + 1.0)
        return np.asarray(np.ceil(steps), dtype=np.int64)
