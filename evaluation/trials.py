"""The trials: starts and goals that every policy faces alike."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from kinarm.errors import MOST_TRIALS, whole_number
from kinarm.problem import ProblemLike, ReachProblem
from kinarm.scenarios import draw_scenarios
from kinarm.simulator import Simulator
from kinarm.task import RewardWeights

LOT = 4096
"""Trials drawn together."""


def trial_generator(seed: int, trial: int, stream: int = 0) -> np.random.Generator:
    """Random generator of one trial, independent of others.

    Parameters
    ----------
    seed, trial : int
        Seed of the set, and number of the trial in it.
    stream : int
        0 draws the trial; others are for contestants that act at random.
    """
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(trial, stream)))


@dataclass(frozen=True, eq=False)
class TrialSet:
    """Starts and goals, a function of the problem and a seed alone.

    The first trials of a set are the same for every size.

    Attributes
    ----------
    simulator, seed : Simulator, int
        What they are faced in, and what they were drawn from.
    starts, goals : ndarray, shape (n, n_joints) and (n, goal_width)
        Start configurations [rad or m] and goal positions [m].
    """

    simulator: Simulator
    seed: int
    starts: NDArray[np.float64]
    goals: NDArray[np.float64]

    @classmethod
    def draw(cls, problem: ProblemLike | Simulator, trials: int, seed: int) -> "TrialSet":
        """Draw a set of trials.

        Parameters
        ----------
        problem : ReachProblem, str, Path or Simulator
            The problem, its name or file; or a simulator of it.
        trials, seed : int
            Number of trials, and seed of the set.
        """
        simulator = problem if isinstance(problem, Simulator) else Simulator(problem)
        trials, seed = whole_number("trials", trials, 1, MOST_TRIALS), whole_number("seed", seed, 0)
        lots = (range(first, min(first + LOT, trials)) for first in range(0, trials, LOT))
        drawn = [
            draw_scenarios(simulator.world, [trial_generator(seed, trial) for trial in lot], 1)
            for lot in lots
        ]
        starts, goals = (np.concatenate(part)[:, 0] for part in zip(*drawn, strict=True))
        starts.flags.writeable = goals.flags.writeable = False
        return cls(simulator, seed, starts, goals)

    def chosen(self, numbers: Sequence[int]) -> "TrialSet":
        """The trials of some numbers, in their order."""
        rows = list(numbers)
        return replace(self, starts=self.starts[rows], goals=self.goals[rows])

    def first(self, count: int) -> "TrialSet":
        """The first trials, or all if there are fewer."""
        return self if len(self) <= count else self.chosen(range(count))

    def __len__(self) -> int:
        return len(self.starts)

    def __repr__(self) -> str:
        return f"TrialSet({len(self)} trials of {self.problem.name}, seed {self.seed})"

    @property
    def problem(self) -> ReachProblem:
        """The problem that is faced."""
        return self.simulator.problem

    @property
    def rules(self) -> ReachProblem:
        """The problem without its reward and observation, by which trials do not differ."""
        return self.problem.unseen.replace(reward=RewardWeights())

    @cached_property
    def digest(self) -> str:
        """Hash of starts, goals and `rules`."""
        numbers = np.round(np.concatenate([self.starts, self.goals], axis=1), 12) + 0.0
        content = self.rules.digest.encode() + numbers.tobytes()
        return hashlib.sha256(content).hexdigest()[:16]

    def first_difference(self, other: "TrialSet") -> str | None:
        """Say what sets another set apart, such as ``"seed is 1, not 0"``; None if nothing does."""
        if self.digest == other.digest:
            return None
        if different := self.rules.first_difference(other.rules):
            return different
        if self.seed != other.seed:
            return f"seed is {other.seed}, not {self.seed}"
        return f"there are {len(other)} trials, not {len(self)}"


trial_set = cache(TrialSet.draw)
"""Trials of a problem, drawn once in a process; see `TrialSet.draw`."""
