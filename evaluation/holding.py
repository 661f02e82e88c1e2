"""Trials that success does not end: how close policies come, and whether they stay there."""

import sys
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinarm.episodes import Rollouts
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.contestants import ORACLE, Contestant
from kinarm.evaluation.outcomes import HOLDING_STEPS
from kinarm.evaluation.trials import TrialSet

NEVER = sys.float_info.min
"""A tolerance that nothing meets [m]."""

AIM = 0.005
"""How close the oracle's motions are to come where success does not end trials [m]."""


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
    collision, steps : ndarray, shape (n,)
        Whether contact ended the trial, and steps taken.
    """

    closest: NDArray[np.float64]
    farthest_at_end: NDArray[np.float64]
    collision: NDArray[np.bool_]
    steps: NDArray[np.int64]

    @classmethod
    def of(cls, rollouts: Rollouts, trials: TrialSet) -> "Holding":
        """Measure rollouts that kept the configurations visited."""
        paths = rollouts.paths[:, 1:]
        visited = ~np.isnan(paths[..., 0])
        tools = trials.simulator.world.poses(paths[visited])[:, :3, 3]
        aims = np.broadcast_to(rollouts.goals[:, None], (*visited.shape, 3))[visited]
        distances = np.full(visited.shape, np.nan)
        distances[visited] = np.linalg.norm(tools - aims, axis=1)
        at_end = distances[:, -HOLDING_STEPS:].max(axis=1)
        return cls(
            closest=np.nanmin(distances, axis=1),
            farthest_at_end=np.where(rollouts.collision, np.inf, at_end),
            collision=rollouts.collision,
            steps=rollouts.steps,
        )


def measure_holding(contestant: Contestant, trials: TrialSet) -> Holding:
    """Let a contestant face trials that success does not end; the oracle aims at `AIM` there."""
    endless = trials.with_tolerance(NEVER)
    if contestant is ORACLE:
        aimed = trials.with_tolerance(min(AIM, trials.problem.task.tolerance))
        actions = oracle_bounds(aimed).actions
        scenarios = (endless.starts, endless.goals)
        rollouts = endless.simulator.rollout_actions(actions, *scenarios, record=True)
    else:
        rollouts = contestant.run(endless, record=True)
    return Holding.of(rollouts, trials)
