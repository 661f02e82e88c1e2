"""Trials that success does not end: how close policies come, and whether they stay there."""

import sys
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.contestants import ORACLE, Contestant
from kinarm.evaluation.outcomes import HOLDING_STEPS
from kinarm.evaluation.trials import TrialSet
from kinarm.rollouts import Rollouts
from kinarm.world import World

NEVER = sys.float_info.min
"""A tolerance that nothing meets [m]."""

AIM = 0.005
"""How close the oracle's motions are to come where success does not end trials [m]."""

LOT = 1000
"""Trials whose distances are worked out together."""


@dataclass(frozen=True, eq=False)
class Holding:
    """How close a policy came, and whether it stayed, in trials that success does not end.

    Attributes
    ----------
    closest : ndarray, shape (n,)
        Smallest distance from the tool to the goal after any step [m].
    farthest_at_end : ndarray, shape (n,)
        Largest distance after the last `HOLDING_STEPS` steps, or all if there are fewer [m];
        infinite where contact ended the trial.
    collision : ndarray of bool, shape (n,)
        Whether contact ended the trial.
    steps : ndarray of int, shape (n,)
        Steps taken.
    """

    closest: NDArray[np.float64]
    farthest_at_end: NDArray[np.float64]
    collision: NDArray[np.bool_]
    steps: NDArray[np.int64]

    def __repr__(self) -> str:
        return f"Holding({len(self.steps)} trials, {int(self.collision.sum())} collisions)"

    @classmethod
    def of(cls, rollouts: Rollouts, trials: TrialSet) -> "Holding":
        """Measure rollouts that kept the configurations visited."""
        lots = [slice(first, first + LOT) for first in range(0, len(rollouts), LOT)]
        distances = [
            _distances(trials.simulator.world, rollouts.paths[lot, 1:], rollouts.goals[lot])
            for lot in lots
        ]
        at_end = np.concatenate([each[:, -HOLDING_STEPS:].max(axis=1) for each in distances])
        return cls(
            closest=np.concatenate([np.nanmin(each, axis=1) for each in distances]),
            farthest_at_end=np.where(rollouts.collision, np.inf, at_end),
            collision=rollouts.collision,
            steps=rollouts.steps,
        )


def _distances(
    world: World, paths: NDArray[np.float64], goals: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Distances from the tool to goals along paths [m], shape (n, n_steps); NaN after their end."""
    visited = ~np.isnan(paths[..., 0])
    distances = np.full(visited.shape, np.nan)
    tools = world.poses(paths[visited])[:, :3, 3]
    aims = np.broadcast_to(goals[:, None], (*visited.shape, 3))[visited]
    distances[visited] = np.linalg.norm(tools - aims, axis=1)
    return distances


def measure_holding(contestant: Contestant, trials: TrialSet) -> Holding:
    """Let a contestant face trials that success does not end.

    Starts and goals are those of the trials. The oracle aims at `AIM` there, and stays where it
    gets to.
    """
    endless = trials.with_tolerance(NEVER)
    if contestant is ORACLE:
        aimed = trials.with_tolerance(min(AIM, trials.problem.task.tolerance))
        actions = oracle_bounds(aimed).actions
        scenarios = (endless.starts, endless.goals)
        return Holding.of(
            endless.simulator.rollout_actions(actions, *scenarios, record=True), trials
        )
    return Holding.of(contestant.run(endless, record=True), trials)
