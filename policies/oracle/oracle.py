"""The oracle: bounds of what any policy could reach, and in how many steps.

For each trial it *proves* bounds and *finds* a motion; the best policy lies
between them.

Proven, by branch and bound over all configurations within reach: the fewest
steps in which any policy can bring the tool within the tolerance of the goal;
and, where none can within the horizon, a distance that no policy can beat, to a
millimetre if the budget suffices. Both ignore contact, and hold with it all the
more. Where the motion found is slower, contact raises the bound: no motion ends
where the arm touches something, as far as its shapes are capsules. Boxes and
distances are enlarged by 1e-9 to cover rounding. When a budget runs out, what
is proven stands, marked as incomplete. Bodies that move raise no bound.

Found, by search, and replayed in the simulator, where bodies move: a contact-free motion to the
goal. It need not be the fastest, and finding none proves nothing.
"""

from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm.errors import (
    MOST_TRIALS,
    InvalidInputError,
    finite_array,
    one_or_many,
    whole_number,
)
from kinarm.kernels.compiling import Array
from kinarm.plant import Plant
from kinarm.policies.oracle.bounding import Prover
from kinarm.policies.oracle.demonstrations import Demonstrations
from kinarm.policies.oracle.inverse import step_box
from kinarm.policies.oracle.motion_search import MotionSearch
from kinarm.problem import ProblemLike
from kinarm.randomness import Stream, stream_generator
from kinarm.simulator import Simulator

ORACLE_SEMANTICS = "2"
"""Version of the oracle's results: raised when they change."""

EXTRA_STEPS = 24
"""Steps above the lower bound that are tried before a detour is planned."""

LOT = 128
"""Trials that are solved together."""

Progress = Callable[[int, int], object]


class Oracle:
    """Bounds what any policy could do in given trials.

    A result does not depend on other trials, their order or the number of
    threads.

    Parameters
    ----------
    problem : ReachProblem, str or Path
        The problem, its name or its file; rewards do not matter. Its plant is
        taken for ideal, which reaches goals soonest.
    threads : int, optional
        Threads to use; by default as many as available processors.
    """

    def __init__(self, problem: ProblemLike, *, threads: int | None = None) -> None:
        self.simulator = Simulator(problem, threads=threads).with_plant(Plant())
        self._prover = Prover(self.simulator.without_moving_bodies())

    def __repr__(self) -> str:
        return f"Oracle({self.simulator.problem!r})"

    def solve(self, start: ArrayLike, goal: ArrayLike) -> "OracleSolution":
        """Solve one trial; see `solve_batch`."""
        q = finite_array("start", start, (self.simulator.arm.n_joints,))
        return self.solve_batch(q[None], finite_array("goal", goal, (3,))[None])[0]

    def solve_batch(
        self, starts: ArrayLike, goals: ArrayLike, *, on_progress: Progress | None = None
    ) -> "OracleSolutions":
        """Solve many trials.

        Parameters
        ----------
        starts : array_like, shape (n, n_joints) or (n_joints,)
            Contact-free start configurations, or one for all goals [rad or m].
        goals : array_like, shape (n, 3) or (3,)
            Goal positions, or one for all starts [m].
        on_progress : callable, optional
            Called with the numbers of trials solved and in all.

        Raises
        ------
        StartInContactError
            If a start touches something.
        """
        q, g = self._scenarios(starts, goals)
        parts = []
        for first in range(0, max(len(q), 1), LOT):
            lot = slice(first, first + LOT)
            parts += self._solve_lots(q[lot], g[lot])
            if on_progress is not None:
                on_progress(min(first + LOT, len(q)), len(q))
        return OracleSolutions.concatenated(parts)

    def demonstrate(
        self, starts: ArrayLike, goals: ArrayLike, *, on_progress: Progress | None = None
    ) -> Demonstrations:
        """Show motions that reach the goals of trials; trials without one are left out.

        Parameters
        ----------
        starts, goals, on_progress
            As for `solve_batch`.

        Raises
        ------
        InvalidInputError
            If no motion reaches its goal.
        """
        q, g = self._scenarios(starts, goals)
        found = self.solve_batch(q, g, on_progress=on_progress)
        reached = found.reachable
        if not reached.any():
            raise InvalidInputError("the oracle finds no motion that could be imitated")
        shown = q[reached], g[reached], found.actions[reached]
        return Demonstrations.replayed(self.simulator, *shown, len(found))

    def demonstrations(
        self, n: int, *, seed: int = 0, on_progress: Progress | None = None
    ) -> Demonstrations:
        """Draw n trials, and show motions that reach their goals; see `demonstrate`.

        Parameters
        ----------
        n, seed : int
            Number of trials, and their seed; evaluations draw others.
        on_progress : callable, optional
            As for `solve_batch`.
        """
        rng = stream_generator(Stream.DEMONSTRATIONS, whole_number("seed", seed, 0))
        scenarios = self.simulator.sample(rng, whole_number("n", n, 1, MOST_TRIALS))
        return self.demonstrate(*scenarios, on_progress=on_progress)

    def _scenarios(self, starts: ArrayLike, goals: ArrayLike) -> tuple[Array, Array]:
        """Starts and goals, one row a trial, if they are possible."""
        q, one_start = one_or_many("starts", starts, (self.simulator.arm.n_joints,))
        g, one_goal = one_or_many("goals", goals, (3,))
        q = np.tile(q, (len(g) if one_start else 1, 1))
        g = np.tile(g, (len(q) if one_goal else 1, 1))
        episodes = self.simulator.reset(q, g)
        return episodes.q, episodes.goal

    def _solve_lots(self, starts: Array, goals: Array) -> "list[OracleSolutions]":
        """Solve trials together, or each in its own scene."""
        if not self.simulator.world.has_random_bodies:
            return [self._solve_lot(starts, goals)]
        found = []
        for row in range(len(starts)):
            alone = copy(self)
            alone.simulator = self.simulator.in_scene(starts[row], goals[row])
            alone._prover = Prover(alone.simulator.without_moving_bodies())
            found.append(alone._solve_lot(starts[row : row + 1], goals[row : row + 1]))
        return found

    def _solve_lot(self, starts: Array, goals: Array) -> "OracleSolutions":
        """Bounds, motions and their replay."""
        horizon, n = self.simulator.task.horizon, len(starts)
        search = MotionSearch(self.simulator, starts, goals)
        trials, limits = (starts, goals, search.witnesses), np.tile([[1], [horizon]], n)
        steps_bounds, complete = self._prover.bound_steps(*trials, np.arange(n), *limits)
        within = np.flatnonzero(steps_bounds <= horizon)
        for extra in range(EXTRA_STEPS + 1):
            search.try_steps(within, steps_bounds[within] + extra)
        search.try_detours(within)
        self._count_contact(search, steps_bounds, complete)
        distance_bounds = self._approach(search, steps_bounds)
        replay = self.simulator.rollout_actions(search.actions, starts, goals, record=True)
        # A motion that was to come close may reach the goal all the same.
        distance_bounds[replay.success] = 0.0
        complete |= replay.success & (replay.steps == steps_bounds)
        no_motion = f"no contact-free motion of {horizon} steps or less found"
        no_end = "no contact-free configuration at the goal found"
        reasons = [no_motion if steps <= horizon else no_end for steps in search.solved]
        for row in np.flatnonzero(steps_bounds > horizon):
            away = f"{distance_bounds[row]:.3f} m away or more within {horizon} steps"
            reasons[row] = f"out of reach: proven to stay {away}"
        return OracleSolutions(
            reachable=replay.success,
            proof_complete=complete,
            steps=replay.steps,
            steps_lower_bound=steps_bounds,
            final_distance=replay.distance,
            distance_lower_bound=distance_bounds,
            actions=search.actions,
            paths=replay.paths,
            reasons=np.array(np.where(replay.success, "", reasons), dtype=np.str_),
        )

    def _count_contact(
        self, search: MotionSearch, steps_bounds: NDArray[np.int64], complete: NDArray[np.bool_]
    ) -> None:
        """Raise bounds where motions are slower, or none reaches the goal."""
        horizon = self.simulator.task.horizon
        trials = (search.starts, search.goals, search.witnesses)
        bound_steps = self._prover.bound_steps
        # A contact-free configuration ends the proof, even without a motion to it.
        fewest = np.fmin(search.steps, search.solved)
        slow = np.flatnonzero(search.reached & (fewest > steps_bounds))
        steps_bounds[slow], complete[slow] = bound_steps(
            *trials, slow, steps_bounds[slow], fewest[slow] - 1, contact=True
        )
        blocked = np.flatnonzero((fewest > horizon) & (steps_bounds <= horizon))
        last = np.full(blocked.size, horizon)
        beyond, _ = bound_steps(*trials, blocked, last, last, contact=True)
        complete[~search.reached & (steps_bounds <= horizon)] = False
        shut = blocked[beyond > horizon]
        steps_bounds[shut], complete[shut] = horizon + 1, True

    def _approach(self, search: MotionSearch, steps_bounds: NDArray[np.int64]) -> Array:
        """Prove, and seek, how close motions come to goals that none reaches."""
        task, missed = self.simulator.task, np.flatnonzero(~search.reached)
        starts, goals = search.starts[missed], search.goals[missed]
        box = step_box(self.simulator, starts, np.full(missed.size, task.horizon))
        proven, search.witnesses[missed] = self._prover.bound_distance(starts, goals, box)
        distances = np.zeros(len(steps_bounds))
        distances[missed] = proven[:, 0]
        out_of_reach = steps_bounds > task.horizon
        distances[out_of_reach] = np.fmax(distances[out_of_reach], task.tolerance)
        search.try_approach(missed, np.fmax(distances[missed], task.tolerance))
        return distances


@dataclass(frozen=True, eq=False)
class OracleSolution:
    """Bounds and motion of one trial.

    Attributes
    ----------
    reachable : bool
        Whether the motion reaches the goal in the simulator.
    steps : int
        Steps of the motion; the horizon if it does not reach the goal.
    steps_lower_bound : int
        Proven: no motion reaches the goal in fewer steps. The horizon + 1 if it
        is out of reach.
    proof_complete : bool
        Whether a configuration at the goal, not proven to touch anything, is
        that many steps away, the motion takes as many, or the goal is proven to
        be out of reach. Else the budget ran out. Contact on the way may make
        ``steps`` larger.
    final_distance : float
        Distance from tool to goal at the end of the motion [m].
    distance_lower_bound : float
        Proven: no motion within the horizon ends closer [m]. Zero if one
        reaches the goal.
    path : ndarray, shape (steps + 1, n_joints)
        Configurations of the motion in the simulator [rad or m].
    actions : ndarray, shape (steps, n_actions)
        Actions of the motion.
    reason : str or None
        Why no motion reaches the goal; None if one does.
    """

    reachable: bool
    steps: int
    steps_lower_bound: int
    proof_complete: bool
    final_distance: float
    distance_lower_bound: float
    path: NDArray[np.float64]
    actions: NDArray[np.float64]
    reason: str | None


NUMBERS = [item.name for item in fields(OracleSolution)][:6]


@dataclass(frozen=True, eq=False)
class OracleSolutions:
    """Bounds and motions of n trials; indexing gives an `OracleSolution`.

    Its fields are arrays of shape (n,) here; the others are

    Attributes
    ----------
    actions : ndarray, shape (n, horizon, n_actions)
        Actions of the motions, zero after their end.
    paths : ndarray, shape (n, horizon + 1, n_joints)
        Configurations of the motions, NaN after their end [rad or m].
    reasons : ndarray of str, shape (n,)
        Why no motion reaches the goal; empty if one does.
    """

    reachable: NDArray[np.bool_]
    proof_complete: NDArray[np.bool_]
    steps: NDArray[np.int64]
    steps_lower_bound: NDArray[np.int64]
    final_distance: NDArray[np.float64]
    distance_lower_bound: NDArray[np.float64]
    actions: NDArray[np.float64]
    paths: NDArray[np.float64]
    reasons: NDArray[np.str_]

    def __post_init__(self) -> None:
        for array in vars(self).values():
            array.flags.writeable = False

    def __len__(self) -> int:
        return len(self.steps)

    def __repr__(self) -> str:
        return f"OracleSolutions({len(self)} trials, {int(self.reachable.sum())} reached)"

    def __iter__(self) -> Iterator[OracleSolution]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: int) -> OracleSolution:
        steps, known = int(self.steps[index]), vars(self)
        return OracleSolution(
            **{name: known[name][index].item() for name in NUMBERS},
            path=self.paths[index, : steps + 1],
            actions=self.actions[index, :steps],
            reason=str(self.reasons[index]) or None,
        )

    @classmethod
    def concatenated(cls, parts: "list[OracleSolutions]") -> "OracleSolutions":
        """Join the solutions of several sets of trials."""
        lots = [vars(part) for part in parts]
        return cls(**{name: np.concatenate([lot[name] for lot in lots]) for name in lots[0]})
