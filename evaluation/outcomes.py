"""How trials ended, and why they failed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm.episodes import Rollouts
from kinarm.evaluation.schemas import Document
from kinarm.evaluation.trials import TrialSet

EARLY_STEPS = 3
"""Contact within so many steps is early: the arm started close to it."""

HOLDING_STEPS = 10
"""Last steps of a trial over which the goal is to be held."""

Pair = tuple[str, str]
"""Names of two bodies that touch."""


@dataclass(frozen=True, eq=False)
class Holding:
    """How close a policy came and stayed in trials that success does not end.

    Attributes
    ----------
    closest : ndarray, shape (n,)
        Smallest distance of the tool from the goal after any step [m].
    farthest_at_end : ndarray, shape (n,)
        Largest distance after the last `HOLDING_STEPS` steps, or all if fewer
        [m]; infinite where contact ended the trial.
    collision, steps : ndarray, shape (n,)
        Whether contact ended the trial, and steps taken.
    """

    closest: NDArray[np.float64]
    farthest_at_end: NDArray[np.float64]
    collision: NDArray[np.bool_]
    steps: NDArray[np.int64]

    @classmethod
    def of(cls, rollouts: Rollouts, trials: TrialSet) -> "Holding":
        """Measure rollouts that kept their configurations."""
        paths = rollouts.paths[:, 1:]
        visited = ~np.isnan(paths[..., 0])
        tools = trials.simulator.world.poses(paths[visited])[:, :3, 3]
        aims = rollouts.goal_paths[:, 1:, :3]
        if not len(aims):
            aims = np.broadcast_to(rollouts.goals[:, None, :3], (*visited.shape, 3))
        aims = aims[visited]
        distances = np.full(visited.shape, np.nan)
        distances[visited] = np.linalg.norm(tools - aims, axis=1)
        at_end = distances[:, -HOLDING_STEPS:].max(axis=1)
        return cls(
            closest=np.nanmin(distances, axis=1),
            farthest_at_end=np.where(rollouts.collision, np.inf, at_end),
            collision=rollouts.collision,
            steps=rollouts.steps,
        )


def _joined(field: str, name: str, meaning: str) -> "cached_property[NDArray[Any]]":
    """Column of all seeds and resampled trials in a field of `Outcomes`."""

    def joined(self: "Outcomes") -> NDArray[Any]:
        columns = (getattr(seed, name) for seed in getattr(self, field))
        numbers = self.numbers
        chosen = [each if numbers is None or not len(each) else each[numbers] for each in columns]
        return np.concatenate(chosen, axis=-1)

    joined.__doc__ = meaning
    return cached_property(joined)


@dataclass(frozen=True, eq=False)
class Outcomes:
    """Outcomes of one or several training seeds in the same trials.

    Their arrays are joined along the last axis, shape (..., n_seeds *
    n_trials).

    Attributes
    ----------
    rollouts : tuple of Rollouts
        One per training seed.
    bounds : OracleSolutions or None
        What any policy could do in the trials, or in the first ones, if known.
    holding : tuple of Holding
        What they did without an end at success, if known.
    time_step : float
        Duration of a step [s].
    numbers : ndarray of int, shape (..., n_trials), optional
        Resampled trials; each once by default.
    """

    rollouts: tuple[Rollouts, ...]
    bounds: Any = None
    holding: tuple[Holding, ...] = ()
    time_step: float = float("nan")
    numbers: NDArray[np.int64] | None = None

    def resampled(self, numbers: NDArray[np.int64]) -> "Outcomes":
        """The same of trials by their numbers, shape (..., n_trials)."""
        return replace(self, numbers=numbers)

    def of_seed(self, seed: int) -> "Outcomes":
        """Outcomes of one of the training seeds."""
        one = slice(seed, seed + 1)
        return replace(self, rollouts=self.rollouts[one], holding=self.holding[one])

    distance = _joined("rollouts", "distance", "Final distances [m].")
    steps = _joined("rollouts", "steps", "Steps taken.")
    success = _joined("rollouts", "success", "Whether a trial ended in success.")
    collision = _joined("rollouts", "collision", "Whether a trial ended in contact.")
    turn = _joined("rollouts", "turn", "Final errors of the goals' rests; empty if they have none.")
    goals_reached = _joined("rollouts", "goals_reached", "Goals reached; empty if not counted.")
    interventions = _joined("rollouts", "interventions", "Replaced steps; empty without shield.")
    closest = _joined("holding", "closest", "Closest approaches where success ends no trial [m].")
    farthest_at_end = _joined("holding", "farthest_at_end", "Largest last distances there [m].")
    holding_collision = _joined("holding", "collision", "Whether trials ended in contact there.")

    @cached_property
    def ordered_distance(self) -> NDArray[np.float64]:
        """Final distances along the last axis, the smallest first [m]."""
        return np.sort(self.distance, axis=-1)

    @property
    def goals_per_minute(self) -> float | None:
        """Goals of sequences that were reached, per minute."""
        reached, steps = self.goals_reached, self.steps.sum()
        return float(60.0 * reached.sum() / (steps * self.time_step)) if len(reached) else None

    @property
    def relative_success(self) -> float | None:
        """Success divided by the oracle's, in the bounded trials; None if that is unknown or 0."""
        if self.bounds is None or not self.bounds.reachable.any():
            return None
        reachable = self.bounds.reachable
        succeeded = [rollouts.success[: len(reachable)] for rollouts in self.rollouts]
        return float(np.mean(succeeded) / reachable.mean())

    @cached_property
    def step_ratio(self) -> NDArray[np.float64]:
        """Steps over those proven necessary, of successful bounded trials, one axis."""
        if self.bounds is None:
            return np.empty(0)
        necessary = self.bounds.steps_lower_bound
        bounded = slice(len(necessary))
        ratios = [
            (rollouts.steps[bounded] / necessary)[rollouts.success[bounded]]
            for rollouts in self.rollouts
        ]
        return np.concatenate(ratios)


class Cause(Document, frozen=True):
    """Why a trial failed.

    Parameters
    ----------
    contact : tuple of str, optional
        The bodies that touched; null where the steps ran out.
    early : bool
        Whether they did within the first steps.
    """

    contact: Pair | None
    early: bool

    def __str__(self) -> str:
        if self.contact is None:
            return "truncated"
        when = f"within {EARLY_STEPS} steps" if self.early else f"after {EARLY_STEPS} steps"
        return f"{self.contact[0]} touches {self.contact[1]} {when}"


def failure_causes(
    outcomes: Sequence[str], steps: Sequence[int], contacts: Sequence[Pair | None]
) -> dict[int, Cause]:
    """Causes of the trials that failed, by their numbers.

    Parameters
    ----------
    outcomes, steps, contacts
        How trials ended, after how many steps, and what touched.
    """
    return {
        trial: Cause(contacts[trial], outcome == "collision" and steps[trial] <= EARLY_STEPS)
        for trial, outcome in enumerate(outcomes)
        if outcome != "success"
    }
