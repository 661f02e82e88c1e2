"""Search for the motions that reach goals in the fewest steps."""

import hashlib

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.compiling import Array
from kinarm.policies.oracle.goals import Stage
from kinarm.policies.oracle.inverse import Solutions, solve_within, step_box, steps_between
from kinarm.policies.planning.motions import Motions
from kinarm.policies.planning.paths import find_path, on_path
from kinarm.randomness import low_discrepancy_points
from kinarm.simulator import Simulator

SAMPLES, VIAS = (8, 48, 512), 128
"""Configurations to seek goals from, in turn, and motions by way of others, per number of steps."""

DETOURS = 4
"""Detours planned for a trial; the shortest counts."""

BEGINNINGS, SEPARATION = 1024, 0.2
"""Configurations from which ends of detours are sought, and least difference of two in some joint
[rad or m]."""

APPROACHES = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
"""Distances beyond the tolerance that are tried in turn [m]."""

MISS_COST = 1000.0
"""Cost of a contact-free miss, beside its final distance in metres."""


class MotionSearch:
    """The best motions found so far for some trials.

    Reaching the goal costs the steps to it, missing it more, and contact is
    ruled out. The outcome in the simulator counts. A goal that is to be held is
    reached in the first of those steps.

    Parameters
    ----------
    simulator : Simulator
        Of one goal an episode.
    starts : ndarray, shape (n, n_joints)
        Where motions begin [rad or m].
    stage : Stage
        The goals.
    taken : ndarray of int, shape (n,), optional
        Steps that episodes have taken before.

    Attributes
    ----------
    left : ndarray of int, shape (n,)
        Steps in which a goal has to be reached.
    witnesses : ndarray, shape (n, n_joints)
        Configurations that attain what was proven last [rad or m].
    actions : ndarray, shape (n, horizon, n_actions)
        The motions; zero where there is none.
    costs : ndarray, shape (n,)
        Their costs; infinite where there is none.
    ends : ndarray, shape (n, n_joints)
        Where they end [rad or m].
    solved : ndarray of int, shape (n,)
        Fewest steps to a contact-free configuration at the goal, with or
        without a motion; the horizon + 1 if none was found.
    """

    def __init__(
        self,
        simulator: Simulator,
        starts: Array,
        stage: Stage,
        taken: NDArray[np.int64] | None = None,
    ) -> None:
        n, self.simulator, self.starts, self.stage = len(starts), simulator, starts, stage
        self.taken = np.zeros(n, dtype=np.int64) if taken is None else taken
        self.left = simulator.task.horizon - (simulator.task.goal.hold - 1) - self.taken
        self._resting = simulator.without_moving_bodies()
        self.witnesses = starts.copy()
        self.actions = np.zeros((n, simulator.task.horizon, simulator.n_actions))
        self.costs, self.ends = np.full(n, np.inf), starts.copy()
        self.solved = np.full(n, simulator.task.horizon + 1)

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Whether the motions reach the goals, shape (n,)."""
        return self.costs <= self.simulator.task.horizon

    @property
    def steps(self) -> NDArray[np.int64]:
        """Steps of the motions, shape (n,); the horizon + 1 for a miss."""
        return np.asarray(np.fmin(self.costs, self.simulator.task.horizon + 1), dtype=np.int64)

    def try_steps(self, rows: NDArray[np.int64], steps: NDArray[np.int64]) -> None:
        """Look for motions of so many steps where none reaches the goal yet."""
        for samples in SAMPLES:
            due = ~self.reached[rows] & (steps <= self.left[rows])
            rows, steps = rows[due], steps[due]
            if rows.size == 0:
                return
            solutions = self._try_straight(rows, steps, 0.0, samples)
            np.minimum.at(self.solved, rows[solutions.owner], steps[solutions.owner])
        self._try_vias(rows, steps, solutions, np.flatnonzero(~self.reached[rows] & (steps > 1)))

    def try_detours(self, rows: NDArray[np.int64]) -> None:
        """Plan detours where no motion reaches the goal yet, if it stands."""
        missed = rows[~self.reached[rows]]
        if self.stage.walks is not None or missed.size == 0:
            return
        motions = Motions(self._resting.world)
        for row in missed:
            ends = self._ends(row)
            if len(ends) == 0:
                continue
            nearest = steps_between(self.simulator, self.starts[row], ends[0])
            self.solved[row] = min(self.solved[row], int(np.ceil(nearest)))
            # Random numbers of a trial depend on its start and goal alone.
            numbers = np.concatenate([self.starts[row], self.stage.goals[row]]) + 0.0
            digest = hashlib.sha256(numbers.tobytes()).digest()
            rng = np.random.default_rng(np.frombuffer(digest, dtype=np.uint32))
            for _ in range(DETOURS):
                path = find_path(motions, self.starts[row], ends, rng)
                if path is None:
                    break
                for through_corners in (False, True):
                    actions = along_path(self.simulator, path, through_corners=through_corners)
                    if actions is not None:
                        self._replay(np.array([row]), actions[None])

    def _ends(self, row: int) -> Array:
        """Distinct configurations at a trial's goal without contact, the soonest reached first."""
        start, goal = self.starts[row, None], self.stage.goals[row, None]
        most, within = np.array([self.simulator.task.horizon]), self.simulator.task.tolerance
        found, _ = solve_within(self._resting, start, goal, most, within, start, BEGINNINGS)
        order = steps_between(self.simulator, start, found).argsort(kind="stable")
        remaining, distinct = found[order], []
        while len(remaining):
            distinct.append(remaining[0])
            apart = np.abs(remaining - remaining[0]).max(axis=1)
            remaining = remaining[apart > SEPARATION]
        return np.array(distinct)

    def try_approach(self, rows: NDArray[np.int64]) -> None:
        """Look for motions that end close to goals that none reaches."""
        for farther in APPROACHES:
            rows = rows[np.isinf(self.costs[rows])]
            if rows.size == 0:
                return
            steps = np.fmax(self.left[rows], 1)
            solutions = self._try_straight(rows, steps, farther, SAMPLES[-1])
            due = np.isinf(self.costs[rows]) & (steps > 1)
            self._try_vias(rows, steps, solutions, np.flatnonzero(due))

    def _try_straight(
        self, rows: NDArray[np.int64], steps: NDArray[np.int64], farther: float, samples: int
    ) -> Solutions:
        """Try straight motions to the goals, or so much farther [m]; owners count in ``rows``."""
        starts, goals, guesses = self.starts[rows], self.stage.goals[rows], self.witnesses[rows]
        if self.stage.walks is not None:
            # The middle of the steps in which the goal is to be held.
            middle = steps + (self.simulator.task.goal.hold - 1) // 2
            goals = self.stage.walks[rows, middle]
        within = self.simulator.task.tolerance + farther
        found = solve_within(self._resting, starts, goals, steps, within, guesses, samples)
        owner, ends = found.owner, found.configurations
        due = steps[owner]
        motions = two_segments(self.simulator, starts[owner], ends, ends, due, due)
        self._replay(rows[owner], motions)
        return found

    def _try_vias(
        self,
        rows: NDArray[np.int64],
        steps: NDArray[np.int64],
        solutions: Solutions,
        due: NDArray[np.int64],
    ) -> None:
        """Try motions by way of configurations between starts and solutions."""
        lots = [np.flatnonzero(solutions.owner == row) for row in due]
        chosen = [np.resize(lot, VIAS) for lot in lots if lot.size]
        if not chosen:
            return
        index = np.concatenate(chosen)
        owner, ends = solutions.owner[index], solutions.configurations[index]
        starts, total, moved = self.starts[rows[owner]], steps[owner], self.simulator.n_actions
        spread = np.tile(low_discrepancy_points(VIAS, moved + 1), (len(chosen), 1))
        turn = np.rint((0.25 + 0.5 * spread[:, -1]) * total).astype(np.int64)
        turn = np.clip(turn, 1, total - 1)
        from_start = step_box(self.simulator, starts, turn)
        to_end = step_box(self.simulator, ends, total - turn)
        lower, upper = np.fmax(from_start[0], to_end[0]), np.fmin(from_start[1], to_end[1])
        vias = starts.copy()
        vias[:, :moved] = lower + spread[:, :-1] * (upper - lower)
        self._replay(rows[owner], two_segments(self.simulator, starts, vias, ends, turn, total))

    def _replay(self, trials: NDArray[np.int64], actions: Array) -> None:
        """Run motions in the simulator, and keep those better than before."""
        simulator, taken, later = self.simulator, self.taken[trials], actions
        if taken.any():  # their first steps are those of motions before, and their ends are lost
            later = np.zeros_like(actions)
            for row, steps in enumerate(taken.tolist()):
                later[row, steps:] = actions[row, : actions.shape[1] - steps]
        begun = self.starts[trials], self.stage.goals[trials]
        outcome = simulator.rollout_actions(later, *begun, taken=taken)
        missed = np.where(outcome.collision, np.inf, MISS_COST + outcome.distance)
        steps = outcome.steps - taken - (simulator.task.goal.hold - 1)
        costs = np.where(outcome.success, steps, missed)
        order = np.lexsort((costs, trials))
        best = order[np.unique(trials[order], return_index=True)[1]]
        better = best[costs[best] < self.costs[trials[best]]]
        self.actions[trials[better]] = actions[better]
        self.costs[trials[better]] = costs[better]
        self.ends[trials[better]] = outcome.configurations[better]


def two_segments(
    simulator: Simulator,
    starts: Array,
    vias: Array,
    ends: Array,
    turn: NDArray[np.int64],
    steps: NDArray[np.int64],
) -> Array:
    """Actions that move straight to one configuration, then another, then rest.

    Shape (m, horizon, n_actions).

    Parameters
    ----------
    simulator : Simulator
        The arm, its step and the horizon.
    starts, vias, ends : ndarray, shape (m, n_joints)
        Where the motions begin, turn and end [rad or m].
    turn, steps : ndarray of int, shape (m,)
        Steps to the turn, and to the end; if equal, the ends are not visited.
    """
    moved = slice(simulator.n_actions)
    after = np.maximum(steps - turn, 1)
    first = (vias - starts)[:, moved] / (turn[:, None] * simulator.step_limit)
    second = (ends - vias)[:, moved] / (after[:, None] * simulator.step_limit)
    step = np.arange(simulator.task.horizon)[None, :, None]
    turning, ending = turn[:, None, None], steps[:, None, None]
    later = np.where(step < ending, second[:, None], 0.0)
    return np.where(step < turning, first[:, None], later)


def along_path(simulator: Simulator, path: Array, *, through_corners: bool) -> Array | None:
    """Actions that follow a path of straight segments at full speed, then rest.

    Shape (horizon, n_actions); None if the horizon is too short.

    Parameters
    ----------
    simulator : Simulator
        The arm, its step and the horizon.
    path : ndarray, shape (m, n_joints)
        Configurations at the corners [rad or m].
    through_corners : bool
        Whether a step ends at every corner; else steps cut corners.
    """
    lengths = steps_between(simulator, path[:-1], path[1:])
    if through_corners:
        lengths = np.ceil(lengths - 1e-9)
    arrival = np.concatenate([[0.0], np.cumsum(lengths)])
    n_steps = int(np.ceil(arrival[-1] - 1e-9))
    if n_steps > simulator.task.horizon:
        return None
    times = np.minimum(np.arange(n_steps + 1), arrival[-1])
    visited = on_path(path, arrival, times)[:, : simulator.n_actions]
    actions = np.zeros((simulator.task.horizon, simulator.n_actions))
    actions[:n_steps] = np.diff(visited, axis=0) / simulator.step_limit
    return actions
