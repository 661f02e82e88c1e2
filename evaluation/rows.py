"""Parts of a document, from what contestants did in trials."""

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec import UNSET

from kinarm.evaluation.bounds import bounds_document
from kinarm.evaluation.document import (
    FacedProblem,
    Failures,
    PooledResult,
    Result,
    TrialEnds,
    TrialHolding,
    WorstSeed,
)
from kinarm.evaluation.outcomes import failure_causes

if TYPE_CHECKING:
    from kinarm.evaluation.evaluation import Evaluation, PooledEvaluation


def faced_problem_of(evaluation: "Evaluation") -> FacedProblem:
    """Entry about a problem, its trials, and what any policy could do there."""
    trials, bounds = evaluation.trials, evaluation.bounds
    return FacedProblem(
        arm=trials.simulator.arm.name,
        problem=trials.problem.pinned.to_json(),
        digest=trials.problem.digest,
        trial_set_hash=trials.digest,
        starts=trials.starts.tolist(),
        goals=trials.goals.tolist(),
        oracle=bounds_document(bounds) if bounds is not None else None,
    )


def result_of(evaluation: "Evaluation") -> Result:
    """Figures of merit of one policy, and every trial."""
    rollouts, holding = evaluation.rollouts, evaluation.holding
    ends = TrialEnds(
        final_distance=rollouts.distance.tolist(),
        steps=rollouts.steps.tolist(),
        outcome=list(evaluation.outcomes),
        contact=list(evaluation.contacts),
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
        **_row(evaluation.contestant.name, [evaluation]),
        metrics=evaluation.metrics,
        training_seed=evaluation.contestant.seed,
        note=evaluation.contestant.note,
        outcomes=ends,
        held=held or UNSET,
    )


def pooled_result_of(pooled: "PooledEvaluation") -> PooledResult:
    """Figures of merit of several training seeds."""
    worst = pooled.worst
    return PooledResult(
        **_row(pooled.name, pooled.members),
        metrics=pooled.metrics,
        members=[member.contestant.name for member in pooled.members],
        training_seeds=[member.contestant.seed for member in pooled.members],
        spread=pooled.spread,
        worst_seed=WorstSeed(
            policy=worst.contestant.name,
            training_seed=worst.contestant.seed,
            success=worst.success,
        ),
    )


def _row(name: str, evaluations: "Sequence[Evaluation]") -> dict[str, Any]:
    """Fields of a row: what it is about, and why trials failed, the most frequent cause first."""
    contestant, trials = evaluations[0].contestant, evaluations[0].trials
    causes = (
        failure_causes(each.outcomes, each.rollouts.steps.tolist(), each.contacts)
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
