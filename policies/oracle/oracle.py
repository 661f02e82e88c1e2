"""The oracle: bounds of what any policy could reach, and in how many steps.

For each trial it *proves* bounds and *finds* a motion; the best policy lies
between them.

Proven, by branch and bound over all configurations within reach: the fewest
steps in which any policy can bring the tool within the tolerance of the goal, or
that none can within the horizon. This ignores contact, and holds with it all the
more. Where the motion found is slower, contact raises the bound: no motion ends
where the arm touches something, as far as its shapes are capsules. Boxes and
distances are enlarged by 1e-9 to cover rounding. When a budget runs out, what
is proven stands, marked as incomplete. Bodies that move raise no bound.

A goal that is held is reached some steps after the first within the tolerances. One that moves has
a proof of its own for each number of steps. In a sequence, a goal is bounded from the start, and by
the goal before: the tool has to leave its tolerances, as fast as its joints could take it together.

Found, by search, and replayed in the simulator, where bodies move: a contact-free motion to the
goal. It need not be the fastest, and finding none proves nothing.
"""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm.errors import one_or_many
from kinarm.kernels.compiling import Array
from kinarm.plant import Plant
from kinarm.policies.oracle.bounding import Prover
from kinarm.policies.oracle.goals import Stage, stages_of
from kinarm.policies.oracle.motion_search import MotionSearch
from kinarm.problem import ProblemLike
from kinarm.simulator import Simulator

ORACLE_SEMANTICS = "5"
"""Version of the oracle's results: raised when they change."""

EXTRA_STEPS = 24
"""Steps above the lower bound that are tried before a detour is planned."""

LOT = 128
"""Trials that are solved together."""

Progress = Callable[[int, int], object]


@dataclass(frozen=True, eq=False)
class OracleSolutions:
    """Bounds and motions of n trials.

    Attributes
    ----------
    reachable : ndarray of bool, shape (n,)
        Whether the motion reaches the goal in the simulator.
    proof_complete : ndarray of bool, shape (n,)
        Whether a configuration at the goal, not proven to touch anything, is
        ``steps_lower_bound`` steps away, the motion takes as many, or the goal
        is proven to be out of reach. Else the budget ran out. Contact on the way
        may make ``steps`` larger.
    steps : ndarray of int, shape (n,)
        Steps of the motion; the horizon if it does not reach the goal.
    steps_lower_bound : ndarray of int, shape (n,)
        Proven: no motion reaches the goal in fewer steps. The horizon + 1 if it
        is out of reach.
    final_distance : ndarray, shape (n,)
        Distance from tool to goal at the end of the motion [m].
    actions : ndarray, shape (n, horizon, n_actions)
        Actions of the motions as planned, of which some arrive sooner; then zero.
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

    @classmethod
    def concatenated(cls, parts: "list[OracleSolutions]") -> "OracleSolutions":
        """Join the solutions of several sets of trials."""
        lots = [vars(part) for part in parts]
        return cls(**{name: np.concatenate([lot[name] for lot in lots]) for name in lots[0]})


class Oracle:
    """Bounds what any policy could do in given trials.

    A result does not depend on other trials, their order or the number of
    threads.

    Parameters
    ----------
    problem : ReachProblem, str or Path
        The problem, its name or its file; rewards do not matter. Its plant is
        taken for ideal, which reaches goals soonest, and motions need no shield.
    threads : int, optional
        Threads to use; by default as many as available processors.
    """

    def __init__(self, problem: ProblemLike, *, threads: int | None = None) -> None:
        self.simulator = Simulator(problem, threads=threads).with_plant(Plant()).shielded(False)
        self._single, goal = self.simulator, self.simulator.task.goal
        if goal.sequence > 1:
            first = self.simulator.problem.replace(goal=replace(goal, sequence=1))
            self._single = Simulator(first, threads=threads).shielded(False)
        self._prover = Prover(self._single.without_moving_bodies())
        # Steps for which a goal is to be held after the first one, and the last that can be first.
        self._rest = goal.hold - 1
        self._last = self.simulator.task.horizon - self._rest

    def __repr__(self) -> str:
        return f"Oracle({self.simulator.problem!r})"

    def solve_batch(
        self, starts: ArrayLike, goals: ArrayLike, *, on_progress: Progress | None = None
    ) -> OracleSolutions:
        """Solve trials, one or many.

        Parameters
        ----------
        starts : array_like, shape (n, n_joints) or (n_joints,)
            Contact-free start configurations, or one for all goals [rad or m].
        goals : array_like, shape (n, goal_width) or (goal_width,)
            Goals, or one for all starts: positions [m] and their rests. Of a
            sequence, the first ones.
        on_progress : callable, optional
            Called with the numbers of trials solved and in all.

        Raises
        ------
        StartInContactError
            If a start touches something.
        """
        q, one_start = one_or_many("starts", starts, (self.simulator.arm.n_joints,))
        g, one_goal = one_or_many("goals", goals, (self.simulator.world.goal_width,))
        q = np.tile(q, (len(g) if one_start else 1, 1))
        g = np.tile(g, (len(q) if one_goal else 1, 1))
        episodes, parts = self.simulator.reset(q, g), []
        q, g = episodes.q, episodes.first_goals
        for first in range(0, max(len(q), 1), LOT):
            lot = slice(first, first + LOT)
            parts += self._solve_lots(q[lot], g[lot])
            if on_progress is not None:
                on_progress(min(first + LOT, len(q)), len(q))
        return OracleSolutions.concatenated(parts)

    def _solve_lots(self, starts: Array, goals: Array) -> list[OracleSolutions]:
        """Solve trials together, or each in its own scene."""
        if not self.simulator.world.has_random_bodies or len(starts) == 0:
            return [self._solve_lot(starts, goals)]
        found = []
        for row in range(len(starts)):
            alone = copy(self)
            alone.simulator = self.simulator.in_scene(starts[row], goals[row])
            alone._single = self._single.in_scene(starts[row], goals[row])
            alone._prover = Prover(alone._single.without_moving_bodies())
            found.append(alone._solve_lot(starts[row : row + 1], goals[row : row + 1]))
        return found

    def _solve_lot(self, starts: Array, goals: Array) -> OracleSolutions:
        """Bounds, motions and their replay."""
        horizon, stages = self.simulator.task.horizon, stages_of(self.simulator, starts, goals)
        search = MotionSearch(self._single, starts, stages[0])
        arrivals, complete = self._search(search)
        self._count_contact(search, arrivals, complete)
        search.try_approach(np.flatnonzero(~search.reached))
        for before, stage in pairwise(stages):
            fewest = arrivals + self._rest + self._prover.steps_apart(before, stage)
            trials = (starts, stage.targets, starts.copy(), np.arange(len(starts)))
            arrivals, complete = self._prover.bound_steps(*trials, fewest, search.left)
            complete &= arrivals > self._last
        steps_bounds = np.where(arrivals > self._last, horizon + 1, arrivals + self._rest)
        actions = self._follow(search, stages)
        replay = self.simulator.rollout_actions(actions, starts, goals, record=True)
        # A motion that was to come close may reach the goal all the same.
        complete |= replay.success & (replay.steps == steps_bounds)
        no_motion = f"no contact-free motion of {horizon} steps or less found"
        no_end = "no contact-free configuration at the goal found"
        reasons = [no_motion if steps <= self._last else no_end for steps in search.solved]
        for row in np.flatnonzero(steps_bounds > horizon):
            reasons[row] = f"out of reach: proven for all motions of {horizon} steps"
        return OracleSolutions(
            reachable=replay.success,
            proof_complete=complete,
            steps=replay.steps,
            steps_lower_bound=steps_bounds,
            final_distance=replay.distance,
            actions=actions,
            paths=replay.paths,
            reasons=np.array(np.where(replay.success, "", reasons), dtype=np.str_),
        )

    def _search(self, search: MotionSearch) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Bound the first step at goals, and look for motions that take few more."""
        rows = np.arange(len(search.starts))
        trials = (search.starts, search.stage.targets, search.witnesses, rows)
        arrivals, complete = self._prover.bound_steps(*trials, np.ones_like(rows), search.left)
        within = np.flatnonzero(arrivals <= search.left)
        for extra in range(EXTRA_STEPS + 1):
            search.try_steps(within, arrivals[within] + extra)
        search.try_detours(within)
        return arrivals, complete

    def _follow(self, search: MotionSearch, stages: list[Stage]) -> Array:
        """Motions to one goal after the other, as far as some are found."""
        actions, rows = search.actions, np.arange(len(search.starts))
        for stage in stages[1:]:
            reached = search.reached
            rows, taken = rows[reached], (search.taken + search.steps)[reached] + self._rest
            search = MotionSearch(self._single, search.ends[reached], stage.of(rows, taken), taken)
            self._search(search)
            for row, steps, motion in zip(rows, taken, search.actions, strict=True):
                actions[row, steps:] = motion[: len(motion) - steps]
        return actions

    def _count_contact(
        self, search: MotionSearch, steps_bounds: NDArray[np.int64], complete: NDArray[np.bool_]
    ) -> None:
        """Raise bounds where motions are slower, or none reaches the goal."""
        trials = (search.starts, search.stage.targets, search.witnesses)
        bound_steps = self._prover.bound_steps
        # A contact-free configuration ends the proof, even without a motion to it.
        fewest = np.fmin(search.steps, search.solved)
        slow = np.flatnonzero(search.reached & (fewest > steps_bounds))
        steps_bounds[slow], complete[slow] = bound_steps(
            *trials, slow, steps_bounds[slow], fewest[slow] - 1, contact=True
        )
        blocked = np.flatnonzero((fewest > self._last) & (steps_bounds <= self._last))
        last = np.full(blocked.size, self._last)
        # Of a goal that moves, all places count.
        first = last if search.stage.walks is None else steps_bounds[blocked]
        beyond, _ = bound_steps(*trials, blocked, first, last, contact=True)
        complete[~search.reached & (steps_bounds <= self._last)] = False
        shut = blocked[beyond > self._last]
        steps_bounds[shut], complete[shut] = self._last + 1, True
