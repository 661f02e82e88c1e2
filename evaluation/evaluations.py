"""Put policies to the trials and summarise how they did."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm.arm import DEFAULT_ARM, Arm
from kinarm.errors import InvalidInputError
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.entrants import Entrant, find_entrants
from kinarm.evaluation.statistics import DistanceStatistics, Share
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.oracle.solution import OracleSolutions
from kinarm.policies.policy import Policy
from kinarm.rollouts import Rollouts
from kinarm.simulator import PolicyFunction, Simulator
from kinarm.task import ReachTask

WITHIN = (0.1, 0.2)
"""Distances whose shares are reported beside success [m]."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """How one policy did on one task.

    Attributes
    ----------
    entrant : Entrant
        The policy.
    trials : TrialSet
        What it faced.
    rollouts : Rollouts
        What it did.
    bounds : OracleSolutions or None
        What any policy could do, if that was asked for.
    """

    entrant: Entrant
    trials: TrialSet
    rollouts: Rollouts
    bounds: OracleSolutions | None = None

    @property
    def task(self) -> str:
        """Name of the task."""
        return self.trials.simulator.task.name

    @cached_property
    def success(self) -> Share:
        """Share of trials that ended within the tolerance."""
        return Share.of(self.rollouts.success)

    @cached_property
    def collision(self) -> Share:
        """Share of trials that ended in contact."""
        return Share.of(self.rollouts.collision)

    @cached_property
    def distance(self) -> DistanceStatistics:
        """Statistics of the final distance."""
        return DistanceStatistics.of(self.rollouts.distance)

    @cached_property
    def contacts(self) -> tuple[tuple[str, str] | None, ...]:
        """Bodies that touched, per trial."""
        return self.trials.simulator.contact_pairs(self.rollouts)

    @property
    def step_ratio(self) -> NDArray[np.float64]:
        """Steps taken over those proven to be necessary, of the trials that succeeded.

        Raises
        ------
        InvalidInputError
            If the evaluation was made without bounds.
        """
        if self.bounds is None:
            raise InvalidInputError(f"{self.entrant.name!r} was evaluated without the oracle")
        ratio: NDArray[np.float64] = self.rollouts.steps / self.bounds.steps_lower_bound
        return ratio[self.rollouts.success]

    @property
    def outcomes(self) -> tuple[str, ...]:
        """``"success"``, ``"collision"`` or ``"horizon"``, per trial."""
        codes = self.rollouts.success + 2 * self.rollouts.collision
        return tuple(("horizon", "success", "collision")[code] for code in codes)

    def within(self, distance: float) -> Share:
        """Share of trials whose final distance is at most ``distance`` [m]."""
        return Share.of(self.rollouts.distance <= distance)

    def to_json(self) -> dict[str, Any]:
        """Summary and every trial, as a dictionary that JSON can hold."""
        return {
            **_identity(self.entrant.name, self.entrant, self.task),
            "training_seed": self.entrant.seed,
            **_figures([self]),
            "outcomes": {
                "final_distance": self.rollouts.distance.tolist(),
                "steps": self.rollouts.steps.tolist(),
                "outcome": list(self.outcomes),
                "contact": [list(pair) if pair else None for pair in self.contacts],
            },
        }


@dataclass(frozen=True, eq=False)
class PooledEvaluation:
    """How several training seeds of one recipe did on the same trials.

    Attributes
    ----------
    name : str
        Name of the group.
    members : tuple of Evaluation
        One per training seed.
    """

    name: str
    members: tuple[Evaluation, ...]

    @property
    def task(self) -> str:
        """Name of the task."""
        return self.members[0].task

    @property
    def success_rates(self) -> tuple[float, ...]:
        """Success of each seed."""
        return tuple(member.success.rate for member in self.members)

    def to_json(self) -> dict[str, Any]:
        """Summary as a dictionary that JSON can hold."""
        rates = np.array(self.success_rates)
        medians = np.array([np.median(member.rollouts.distance) for member in self.members])
        return {
            **_identity(self.name, self.members[0].entrant, self.task),
            "members": [member.entrant.name for member in self.members],
            "training_seeds": [member.entrant.seed for member in self.members],
            **_figures(self.members),
            "spread": {"success": _spread(rates), "median_final_distance": _spread(medians)},
        }


def _identity(name: str, entrant: Entrant, task: str) -> dict[str, Any]:
    return {
        "policy": name,
        "algorithm": entrant.algorithm,
        "recipe": entrant.recipe,
        "task": task,
        "trained_on": entrant.trained_on,
    }


def _spread(values: NDArray[np.float64]) -> dict[str, Any]:
    """Extremes and standard deviation over training seeds."""
    return {
        "min": float(values.min()),
        "max": float(values.max()),
        "std": float(values.std(ddof=1)),
        "each": values.tolist(),
    }


def _figures(evaluations: Sequence[Evaluation]) -> dict[str, Any]:
    """The figures of merit of one evaluation, or pooled over several on the same trials."""
    distance = _stacked([evaluation.rollouts.distance for evaluation in evaluations])
    steps = _stacked([evaluation.rollouts.steps for evaluation in evaluations])
    success = _stacked([evaluation.rollouts.success for evaluation in evaluations])
    collision = _stacked([evaluation.rollouts.collision for evaluation in evaluations])
    return {
        "trials": distance.shape[-1],
        "final_distance": DistanceStatistics.of(distance).to_json(),
        "success": Share.of(success).to_json(),
        "within": {str(limit): Share.of(distance <= limit).to_json() for limit in WITHIN},
        "collision": Share.of(collision).to_json(),
        "steps": {"mean": float(steps.mean()), "median": float(np.median(steps))},
        "oracle": _beside_oracle(evaluations, float(success.mean())),
    }


def _beside_oracle(evaluations: Sequence[Evaluation], success: float) -> dict[str, Any] | None:
    """Figures in relation to the bounds of the trials; None if those are not known."""
    known = [evaluation.bounds for evaluation in evaluations if evaluation.bounds is not None]
    if len(known) < len(evaluations):
        return None
    possible = float(known[0].reachable.mean())
    ratios = np.concatenate([evaluation.step_ratio for evaluation in evaluations])
    return {
        "relative_success": success / possible if possible else None,
        "step_ratio": {
            "trials": ratios.size,
            "median": float(np.median(ratios)) if ratios.size else None,
            "p95": float(np.percentile(ratios, 95)) if ratios.size else None,
        },
    }


def _stacked(arrays: list[NDArray[Any]]) -> NDArray[Any]:
    return np.stack(arrays) if len(arrays) > 1 else arrays[0]


def evaluate(
    policy: str | Path | Policy | Entrant | PolicyFunction,
    task: str | ReachTask | None = None,
    trials: int = 200,
    seed: int = 0,
    *,
    arm: str | Arm = DEFAULT_ARM,
    allow_other_arm: bool = False,
    oracle: bool = False,
) -> Evaluation:
    """Put one policy to the trials (paper, section 3.3: 200 random goals, 64 steps each).

    Parameters
    ----------
    policy : str, Path, Policy, Entrant or function
        A shipped policy, a baseline or the oracle by name (a group's first seed), a file, a
        policy, or a function from observations (n, n_observations) to actions (n, n_actions).
    task : str or ReachTask, optional
        The task; by default the one that the policy was trained on.
    trials : int
        Number of trials.
    seed : int
        Seed of the trials.
    arm : str or Arm
        The arm.
    allow_other_arm : bool
        Whether a policy may face an arm that it was not trained for.
    oracle : bool
        Whether to bound what any policy could do in the trials; see `Evaluation.bounds`.

    Raises
    ------
    InvalidInputError
        If a number is out of range, or no task is given for something untrained.
    PolicyFileError
        If the policy cannot be read or was trained for another arm.
    """
    entrant = _as_entrant(policy)
    task = task or entrant.trained_on
    if task is None:
        raise InvalidInputError(f"{entrant.name!r} was not trained on a task: name one")
    trial_set = TrialSet.draw(Simulator(arm, task), trials, seed)
    return run_trials(entrant, trial_set, allow_other_arm, oracle=oracle)


def _as_entrant(policy: str | Path | Policy | Entrant | PolicyFunction) -> Entrant:
    if isinstance(policy, Entrant):
        return policy
    if isinstance(policy, Policy):
        made = policy.provenance
        return Entrant.from_policy(f"{made.algorithm}-{made.recipe}-{made.task}", policy)
    if isinstance(policy, str | Path):
        return find_entrants(policy)[0]
    return Entrant.from_function(getattr(policy, "__name__", "function"), policy)


def run_trials(
    entrant: Entrant, trials: TrialSet, allow_other_arm: bool = False, *, oracle: bool = False
) -> Evaluation:
    """Let an entrant face a set of trials.

    Parameters
    ----------
    entrant : Entrant
        The policy.
    trials : TrialSet
        What it faces.
    allow_other_arm, oracle
        As for `evaluate`.

    Raises
    ------
    PolicyFileError
        If it was trained for another arm and that is not allowed.
    """
    if not allow_other_arm:
        entrant.check_arm(trials.simulator.arm)
    bounds = oracle_bounds(trials) if oracle else None
    return Evaluation(entrant, trials, entrant.run(trials), bounds)


def pool(evaluations: Sequence[Evaluation]) -> tuple[PooledEvaluation, ...]:
    """Pool the training seeds of each group and task, where there are several."""
    groups: dict[tuple[str | None, ...], list[Evaluation]] = {}
    for evaluation in evaluations:
        made = evaluation.entrant
        key = (made.group, made.algorithm, made.recipe, made.trained_on, evaluation.task)
        groups.setdefault(key, []).append(evaluation)
    return tuple(
        PooledEvaluation(members[0].entrant.group, tuple(members))
        for members in groups.values()
        if len(members) > 1
    )
