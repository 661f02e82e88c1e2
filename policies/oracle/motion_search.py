"""Search for the motions that reach goals in the fewest steps.

Detours are planned by RRT-Connect with shortcuts (Kuffner and LaValle 2000).
"""

import hashlib

import numpy as np
from numpy.typing import NDArray

from kinarm.kernels.compiling import Array
from kinarm.policies.oracle.inverse import (
    Solutions,
    inverse_kinematics,
    solve_within,
    step_box,
    steps_between,
)
from kinarm.randomness import low_discrepancy_points
from kinarm.simulator import Simulator

SAMPLES, VIAS = (8, 48, 512), 128
"""Configurations to seek goals from, in turn, and motions by way of others, per number of steps."""

DETOURS = 4
"""Detours planned for a trial; the shortest counts."""

APPROACHES = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)
"""Distances beyond the smallest possible one that are tried in turn [m]."""

MISS_COST = 1000.0
"""Cost of a contact-free miss, beside its final distance in metres."""


class MotionSearch:
    """The best motions found so far for some trials.

    Reaching the goal costs the steps taken, missing it more, and contact is
    ruled out. The outcome in the simulator counts.

    Attributes
    ----------
    witnesses : ndarray, shape (n, n_joints)
        Configurations that attain what was proven last [rad or m].
    actions : ndarray, shape (n, horizon, n_actions)
        The motions; zero where there is none.
    costs : ndarray, shape (n,)
        Their costs; infinite where there is none.
    solved : ndarray of int, shape (n,)
        Fewest steps to a contact-free configuration at the goal, with or
        without a motion; the horizon + 1 if none was found.
    """

    def __init__(self, simulator: Simulator, starts: Array, goals: Array) -> None:
        n = len(starts)
        self.simulator, self.starts, self.goals = simulator, starts, goals
        self._resting = simulator.without_moving_bodies()
        self.witnesses = starts.copy()
        self.actions = np.zeros((n, simulator.task.horizon, simulator.n_actions))
        self.costs = np.full(n, np.inf)
        self.solved = np.full(n, simulator.task.horizon + 1)

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Whether the motions reach the goals, shape (n,)."""
        return self.costs <= self.simulator.task.horizon

    @property
    def steps(self) -> NDArray[np.int64]:
        """Steps of the motions, shape (n,); the horizon + 1 for a miss."""
        steps: NDArray[np.int64] = np.fmin(self.costs, self.simulator.task.horizon + 1).astype(int)
        return steps

    def try_steps(self, rows: NDArray[np.int64], steps: NDArray[np.int64]) -> None:
        """Look for motions of so many steps where none reaches the goal yet."""
        for samples in SAMPLES:
            due = ~self.reached[rows] & (steps <= self.simulator.task.horizon)
            rows, steps = rows[due], steps[due]
            if rows.size == 0:
                return
            tolerances = np.full(rows.size, self.simulator.task.tolerance)
            solutions = self._try_straight(rows, steps, tolerances, samples)
            np.minimum.at(self.solved, rows[solutions.owner], steps[solutions.owner])
        self._try_vias(rows, steps, solutions, np.flatnonzero(~self.reached[rows] & (steps > 1)))

    def try_detours(self, rows: NDArray[np.int64]) -> None:
        """Plan detours where no motion reaches the goal yet."""
        for row in rows[~self.reached[rows]]:
            ends = inverse_kinematics(self._resting, self.starts[row], self.goals[row])
            if len(ends) == 0:
                continue
            nearest = steps_between(self.simulator, self.starts[row], ends[0])
            self.solved[row] = min(self.solved[row], int(np.ceil(nearest)))
            # Random numbers of a trial depend on its start and goal alone.
            numbers = np.concatenate([self.starts[row], self.goals[row]]) + 0.0
            digest = hashlib.sha256(numbers.tobytes()).digest()
            rng = np.random.default_rng(np.frombuffer(digest, dtype=np.uint32))
            for _ in range(DETOURS):
                path = find_detour(self._resting, self.starts[row], ends, rng)
                if path is None:
                    break
                for through_corners in (False, True):
                    actions = along_path(self.simulator, path, through_corners=through_corners)
                    if actions is not None:
                        self._replay(np.array([row]), actions[None])

    def try_approach(self, rows: NDArray[np.int64], distances: Array) -> None:
        """Look for motions that end as close as possible to goals out of reach."""
        for nearer in APPROACHES:
            due = np.isinf(self.costs[rows])
            rows, distances = rows[due], distances[due]
            if rows.size == 0:
                return
            steps = np.full(rows.size, self.simulator.task.horizon)
            solutions = self._try_straight(rows, steps, distances + nearer, SAMPLES[-1])
            due = np.isinf(self.costs[rows]) & (steps > 1)
            self._try_vias(rows, steps, solutions, np.flatnonzero(due))

    def _try_straight(
        self, rows: NDArray[np.int64], steps: NDArray[np.int64], tolerances: Array, samples: int
    ) -> Solutions:
        """Try straight motions to the goals; owners count in ``rows``."""
        starts, goals, guesses = self.starts[rows], self.goals[rows], self.witnesses[rows]
        found = solve_within(self._resting, starts, goals, steps, tolerances, guesses, samples)
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
        outcome = self.simulator.rollout_actions(actions, self.starts[trials], self.goals[trials])
        missed = np.where(outcome.collision, np.inf, MISS_COST + outcome.distance)
        costs = np.where(outcome.success, outcome.steps, missed)
        order = np.lexsort((costs, trials))
        best = order[np.unique(trials[order], return_index=True)[1]]
        better = best[costs[best] < self.costs[trials[best]]]
        self.actions[trials[better]] = actions[better]
        self.costs[trials[better]] = costs[better]


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
    visited = np.stack(
        [np.interp(times, arrival, path[:, axis]) for axis in range(simulator.n_actions)], axis=1
    )
    actions = np.zeros((simulator.task.horizon, simulator.n_actions))
    actions[:n_steps] = np.diff(visited, axis=0) / simulator.step_limit
    return actions


EXTENSIONS, LONGEST_EXTENSION = 1500, 6.0
"""Samples at most, and how far a tree grows towards one [steps]."""

SHORTCUTS = 120
"""Pairs of points between which the straight way is tried."""


class Tree:
    """Configurations connected to roots by contact-free straight motions."""

    def __init__(self, roots: Array) -> None:
        self.nodes = roots.copy()
        self.parents = [-1] * len(roots)

    def add(self, node: Array, parent: int) -> int:
        """Append a node and return its index."""
        self.nodes = np.concatenate([self.nodes, node[None]])
        self.parents.append(parent)
        return len(self.parents) - 1

    def path_to_root(self, node: int) -> list[Array]:
        """Nodes from this one to its root."""
        found = []
        while node >= 0:
            found.append(self.nodes[node])
            node = self.parents[node]
        return found


def find_detour(
    simulator: Simulator, start: Array, ends: Array, rng: np.random.Generator
) -> Array | None:
    """Find a contact-free path of straight segments to one of several ends.

    Two trees grow in turns until they meet. The path has the shape (m,
    n_joints); None if none was found.

    Parameters
    ----------
    simulator, rng
        Arm and scene, and the source of samples and shortcuts.
    start, ends : ndarray, shape (n_joints,) and (k, n_joints)
        Where the path begins and may end, without contact [rad or m].
    """
    moved, n = slice(simulator.n_actions), simulator.n_actions
    lower, upper = simulator.arm.lower[moved], simulator.arm.upper[moved]
    growing, other = Tree(start[None]), Tree(ends)
    from_start = True
    for _ in range(EXTENSIONS):
        sample = start.copy()
        sample[moved] = rng.uniform(lower, upper, n)
        grown = _extend(simulator, growing, sample, LONGEST_EXTENSION)
        if grown is not None:
            node = growing.nodes[grown]
            met = _extend(simulator, other, node, np.inf)
            if met is not None and steps_between(simulator, other.nodes[met], node) < 1e-9:
                near, far = growing.path_to_root(grown)[::-1], other.path_to_root(met)[1:]
                path = np.array(near + far)
                return _shorten(simulator, path if from_start else path[::-1], rng)
        growing, other, from_start = other, growing, not from_start
    return None


def _extend(simulator: Simulator, tree: Tree, sample: Array, longest: float) -> int | None:
    """Grow a tree towards a sample, as far as nothing touches."""
    distances = steps_between(simulator, tree.nodes, sample)
    nearest = int(distances.argmin())
    if distances[nearest] < 1e-9:
        return nearest
    origin = tree.nodes[nearest]
    towards = origin + min(1.0, longest / distances[nearest]) * (sample - origin)
    on_the_way, free = _straight_way(simulator, origin, towards)
    return tree.add(on_the_way[free - 1], nearest) if free else None


def _straight_way(simulator: Simulator, first: Array, second: Array) -> tuple[Array, int]:
    """Configurations on the way, and how many in a row touch nothing."""
    parts = simulator.world.rules.parts
    count = max(1, int(np.ceil(parts * steps_between(simulator, first, second))))
    tested = first + np.arange(1, count + 1)[:, None] / count * (second - first)
    tested[-1] = second
    _, touching = simulator.world.screen(tested)
    return tested, int(touching.argmax()) if touching.any() else count


def _shorten(simulator: Simulator, path: Array, rng: np.random.Generator) -> Array:
    """Replace parts of a path by the straight way where nothing touches."""
    for _ in range(SHORTCUTS):
        if len(path) < 3:
            break
        lengths = steps_between(simulator, path[:-1], path[1:])
        arrival = np.concatenate([[0.0], np.cumsum(lengths)])
        a, b = np.sort(rng.uniform(0.0, arrival[-1], 2))
        first, second = (
            np.array([np.interp(time, arrival, axis) for axis in path.T]) for time in (a, b)
        )
        if steps_between(simulator, first, second) > b - a - 1e-6:
            continue
        tested, free = _straight_way(simulator, first, second)
        if free == len(tested):
            before, after = path[arrival < a], path[arrival > b]
            path = np.concatenate([before, first[None], second[None], after])
    return path
