"""Put contestants to trials."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from kinarm.episodes import Rollouts
from kinarm.errors import InvalidInputError
from kinarm.evaluation.bounds import MOST_BOUNDED, oracle_bounds
from kinarm.evaluation.contestants import Contestant, Predictor, measure_holding
from kinarm.evaluation.document import (
    Failures,
    PooledResult,
    Result,
    Spread,
    TrialEnds,
    TrialHolding,
    WorstSeed,
)
from kinarm.evaluation.estimates import estimate_metrics
from kinarm.evaluation.finding import contestant_of
from kinarm.evaluation.outcomes import Holding, Outcomes, failure_causes
from kinarm.evaluation.predictors import Wrapper
from kinarm.evaluation.statistics import Estimate
from kinarm.evaluation.trials import TrialSet
from kinarm.networks import PolicyFunction
from kinarm.policies.oracle import OracleSolutions
from kinarm.policies.policy import Policy
from kinarm.problem import ProblemLike, ReachProblem


@dataclass(frozen=True, eq=False)
class Evaluation:
    """How one policy did on one problem: ``rollouts`` of ``trials``.

    ``bounds``, if known, are what any policy could do in the trials, or in the first ones;
    ``holding``, if known, is what this one did where success did not end them.
    """

    contestant: Contestant
    trials: TrialSet
    rollouts: Rollouts
    bounds: OracleSolutions | None = None
    holding: Holding | None = None

    @property
    def name(self) -> str:
        """Name of the policy."""
        return self.contestant.name

    @property
    def members(self) -> tuple["Evaluation", ...]:
        """Itself, where several training seeds would be pooled."""
        return (self,)

    @cached_property
    def problem(self: "Faced") -> ReachProblem:
        """The problem that was faced."""
        return self.members[0].trials.problem

    @cached_property
    def metrics(self: "Faced") -> dict[str, Estimate]:
        """Figures of merit by their name in `kinarm.evaluation.METRICS`."""
        return estimate_metrics(outcomes_of(self.members))

    @property
    def success(self) -> Estimate:
        """Share of trials that ended within the tolerance, without contact."""
        return Estimate.share(self.rollouts.success)

    def within(self, distance: float) -> Estimate:
        """Share of trials whose final distance is at most ``distance`` [m]."""
        return Estimate.share(self.rollouts.distance <= distance)

    @cached_property
    def contacts(self) -> tuple[tuple[str, str] | None, ...]:
        """Bodies that touched, per trial."""
        return self.trials.simulator.contact_pairs(self.rollouts)

    def difference(self: "Faced", other: "Faced") -> dict[str, Estimate]:
        """Figures of merit less those of another, by their name in `kinarm.evaluation.METRICS`.

        Intervals are about other trials, which both would face, and where training seeds are pooled
        also about other trainings, or about the same ones, as with and without a shield.

        Parameters
        ----------
        other : Evaluation or PooledEvaluation
            Whose figures are subtracted.

        Raises
        ------
        InvalidInputError
            If it faced other trials; says what differs.
        """
        trials, others = self.members[0].trials, other.members[0].trials
        if different := trials.first_difference(others):
            raise InvalidInputError(
                f"differences need the same trials, but in the second, {different}"
            )
        sides = self.members, other.members
        trained, again = ([each.contestant.source for each in side] for side in sides)
        paired = len(trained) > 1 and trained == again and None not in trained
        return estimate_metrics(*map(outcomes_of, sides), paired=paired)

    @property
    def result(self) -> Result:
        """Figures of merit and every trial, for a document."""
        rollouts, holding = self.rollouts, self.holding
        ends = TrialEnds(
            final_distance=rollouts.distance.tolist(),
            steps=rollouts.steps.tolist(),
            outcome=list(rollouts.outcomes),
            contact=list(self.contacts),
        )
        held = holding and TrialHolding(
            closest=holding.closest.tolist(),
            farthest_at_end=[
                each if np.isfinite(each) else None for each in holding.farthest_at_end.tolist()
            ],
            contact=holding.collision.tolist(),
            steps=holding.steps.tolist(),
        )
        return Result(
            **common_figures(self.name, [self]),
            metrics=self.metrics,
            training_seed=self.contestant.seed,
            note=self.contestant.note_on(self.problem),
            outcomes=ends,
            held=held or msgspec.UNSET,
        )

    def __repr__(self) -> str:
        on = f"{self.name} on {len(self.trials)} trials of {self.problem.name}"
        return f"Evaluation({on}, success {self.success})"


@dataclass(frozen=True, eq=False)
class PooledEvaluation:
    """How several training seeds of one recipe did on the same trials; intervals are over both."""

    name: str
    members: tuple[Evaluation, ...]

    problem, metrics, difference = Evaluation.problem, Evaluation.metrics, Evaluation.difference

    @property
    def worst(self) -> Evaluation:
        """The training seed with the lowest success."""
        return min(self.members, key=lambda member: int(member.rollouts.success.sum()))

    @property
    def spread(self) -> dict[str, Spread]:
        """How the metrics that all seeds have vary over the seeds."""
        spread = {}
        for name in self.metrics:
            known = [member.metrics[name].value for member in self.members]
            each = [value for value in known if value is not None]
            if len(each) == len(known):
                std = float(np.std(each, ddof=1))
                spread[name] = Spread(min=min(each), max=max(each), std=std, each=each)
        return spread

    @property
    def result(self) -> PooledResult:
        """Figures of merit over all seeds, for a document."""
        worst = self.worst
        return PooledResult(
            **common_figures(self.name, self.members),
            metrics=self.metrics,
            members=[member.contestant.name for member in self.members],
            training_seeds=[member.contestant.seed for member in self.members],
            spread=self.spread,
            worst_seed=WorstSeed(
                policy=worst.contestant.name,
                training_seed=worst.contestant.seed,
                success=worst.success,
            ),
        )

    def __repr__(self) -> str:
        seeds, trials = len(self.members), self.members[0].trials
        on = f"{self.name} on {len(trials)} trials of {self.problem.name}"
        return f"PooledEvaluation({seeds} seeds of {on}, success {self.metrics['success']})"


Faced = Evaluation | PooledEvaluation
"""What a row of the table is about."""


def outcomes_of(members: Sequence[Evaluation]) -> Outcomes:
    """Outcomes of one or several training seeds in the same trials."""
    holding = tuple(member.holding for member in members if member.holding)
    return Outcomes(
        tuple(member.rollouts for member in members),
        members[0].bounds,
        holding if len(holding) == len(members) else (),
        members[0].problem.stepping.time_step,
    )


def common_figures(name: str, evaluations: Sequence[Evaluation]) -> dict[str, Any]:
    """Fields of a row, with causes of failure, the most frequent first."""
    contestant, trials = evaluations[0].contestant, evaluations[0].trials
    causes = (
        failure_causes(each.rollouts.outcomes, each.rollouts.steps.tolist(), each.contacts)
        for each in evaluations
    )
    counts = Counter(cause for each in causes for cause in each.values())
    return {
        "policy": name,
        "algorithm": contestant.algorithm,
        "recipe": contestant.recipe,
        "problem": trials.problem.name,
        "trained_on": contestant.problem.name if contestant.problem else None,
        "trials": len(trials),
        "failures": [
            Failures(
                contact=cause.contact,
                early=cause.early,
                trials=count,
                share_of_failures=count / counts.total(),
            )
            for cause, count in sorted(counts.items(), key=lambda item: (-item[1], str(item[0])))
        ],
    }


def evaluate(
    policy: str | Path | Policy | Contestant | PolicyFunction | Predictor,
    problem: ProblemLike | None = None,
    trials: int = 200,
    seed: int = 0,
    *,
    allow_other_arm: bool = False,
    oracle: bool = False,
    hold: bool = False,
    wrapper: str | Wrapper | None = None,
    **overrides: Any,
) -> Evaluation:
    """Evaluate one policy on the trials (paper, section 3.3: 200 random goals, 64 steps each).

    Parameters
    ----------
    policy : str, Path, Policy, Contestant, function or predictor
        A name or file as for `find_contestants` (of a group, the first seed); a
        policy; a function from observations (n, n_observations) to actions (n,
        n_actions); or what has a ``predict`` as in Stable-Baselines3.
    problem : ReachProblem, str or Path, optional
        The problem; by default the one that the policy was trained for.
    trials, seed : int
        Number and seed of the trials.
    allow_other_arm : bool
        Whether a policy may face an arm that it was not trained for.
    oracle : bool
        Whether to bound what any policy could do, in 2000 trials at most.
    hold : bool
        Whether to run the trials once more without an end at success.
    wrapper : str or callable, optional
        The policy faces the trials in it; see `find_contestants`.
    **overrides
        Changes of the problem, such as ``tolerance``; see
        `kinarm.ReachProblem.replace`.

    Raises
    ------
    InvalidInputError
        If a number is out of range, or an untrained policy has no problem.
    PolicyFileError
        If the policy cannot be read, was trained for another arm, or does not
        fit this one.
    """
    contestant = contestant_of(policy, problem, wrapper)
    faced = problem if problem is not None else contestant.problem
    if faced is None:
        raise InvalidInputError(f"{contestant.name!r} was not trained for a problem: name one")
    drawn = TrialSet.draw(ReachProblem.load(faced).replace(**overrides), trials, seed)
    contestant.check(drawn.problem, drawn.simulator.arm, allow_other_arm=allow_other_arm)
    bounds = oracle_bounds(drawn.first(MOST_BOUNDED)) if oracle else None
    return run_trials(contestant, drawn, bounds=bounds, hold=hold)


def run_trials(
    contestant: Contestant,
    trials: TrialSet,
    *,
    bounds: OracleSolutions | None = None,
    hold: bool = False,
) -> Evaluation:
    """Let a contestant face a set of trials.

    Parameters
    ----------
    contestant, trials : Contestant, TrialSet
        Who faces what.
    bounds : OracleSolutions, optional
        What any policy could do in the trials, or in the first ones.
    hold : bool
        Whether to run the trials once more without an end at success.
    """
    rollouts = contestant.run(trials)  # first: a function may remember what it did
    holding = measure_holding(contestant, trials) if hold else None
    return Evaluation(contestant, trials, rollouts, bounds, holding)
