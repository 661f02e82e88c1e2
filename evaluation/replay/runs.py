"""Recordings of contestants."""

from collections.abc import Sequence

from kinarm._fields import to_plain
from kinarm.evaluation.contestants import Contestant
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.oracle import OracleSolutions
from kinarm.policies.provenance import package_versions, source_commit
from kinarm.recording import Recording, record_rollouts


def record(
    contestant: Contestant,
    trials: TrialSet,
    numbers: Sequence[int] | None = None,
    *,
    bounds: OracleSolutions | None = None,
    allow_other_arm: bool = False,
) -> list[Recording]:
    """Run a contestant on trials and record its motions.

    Parameters
    ----------
    contestant : Contestant
        The policy, baseline or oracle.
    trials : TrialSet
        The trials that it faces.
    numbers : sequence of int, optional
        Trials to keep, in this order; all by default.
    bounds : OracleSolutions, optional
        The oracle's bounds of the trials, or of the first ones.
    allow_other_arm : bool
        Whether a policy may face an arm that it was not trained for.

    Raises
    ------
    InvalidInputError
        If there is no trial of such a number.
    PolicyFileError
        If the policy was trained for another arm, which is not allowed.
    """
    simulator = trials.simulator
    contestant.check(simulator.problem, simulator.arm, allow_other_arm=allow_other_arm)
    rollouts = contestant.run(trials, record=True)
    made = to_plain(contestant.policy.provenance) if contestant.policy else None
    known = [] if bounds is None else bounds.steps_lower_bound.tolist()
    return record_rollouts(
        trials.simulator,
        rollouts,
        contestant.name,
        numbers,
        steps_lower_bound=dict(enumerate(known)).get,
        provenance={
            "trial_seed": trials.seed,
            "policy": made,
            "versions": package_versions(),
            "commit": source_commit(),
            **({"note": note} if (note := contestant.note_on(trials.problem)) else {}),
        },
    )
