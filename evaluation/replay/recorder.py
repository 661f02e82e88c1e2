"""Record what contestants do in trials."""

from collections.abc import Sequence
from functools import partial

from kinarm.evaluation.contestants import Contestant
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.oracle.solution import OracleSolutions
from kinarm.policies.provenance import package_versions, source_commit
from kinarm.recording import Recording, record_rollouts
from kinarm.rollouts import Rollouts


def record(
    contestant: Contestant,
    trials: TrialSet,
    numbers: Sequence[int] | None = None,
    *,
    bounds: OracleSolutions | None = None,
    allow_other_arm: bool = False,
) -> list[Recording]:
    """Run an contestant on trials and record its motions, state by state.

    Parameters
    ----------
    contestant : Contestant
        The policy, baseline or oracle.
    trials : TrialSet
        The trials that it faces.
    numbers : sequence of int, optional
        Trials to keep, in this order; all by default.
    bounds : OracleSolutions, optional
        The oracle's bounds of the trials, or of the first ones, which the replay shows.
    allow_other_arm : bool
        Whether a policy may face an arm that it was not trained for.

    Raises
    ------
    InvalidInputError
        If there is no trial of such a number.
    PolicyFileError
        If the policy was trained for another arm and that is not allowed.
    """
    contestant.check(trials.simulator.arm, allow_other_arm=allow_other_arm)
    return recordings_of(
        contestant, trials, contestant.run(trials, record=True), numbers, bounds=bounds
    )


def recordings_of(
    contestant: Contestant,
    trials: TrialSet,
    rollouts: Rollouts,
    numbers: Sequence[int] | None = None,
    *,
    bounds: OracleSolutions | None = None,
) -> list[Recording]:
    """What an contestant did, as recordings; rollouts kept the configurations, else as `record`."""
    made = contestant.policy.provenance.to_json() if contestant.policy else None
    return record_rollouts(
        trials.simulator,
        rollouts,
        contestant.name,
        numbers,
        steps_lower_bound=None if bounds is None else partial(_lower_bound, bounds),
        provenance={
            "trial_seed": trials.seed,
            "policy": made,
            "versions": package_versions(),
            "commit": source_commit(),
        },
    )


def _lower_bound(bounds: OracleSolutions, trial: int) -> int | None:
    """Proven number of steps of a trial, if the oracle was asked about it."""
    return int(bounds.steps_lower_bound[trial]) if trial < len(bounds) else None
