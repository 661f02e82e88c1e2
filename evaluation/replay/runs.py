"""What contestants do in trials, as recordings: made now, or read from a file."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import cast

from kinarm.errors import InvalidInputError
from kinarm.evaluation.contestants import Contestant, find_contestants
from kinarm.evaluation.outcomes import Cause, End, Outcome, Pair, ends_of, failure_causes
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.library import BEST
from kinarm.policies.oracle.solution import OracleSolutions
from kinarm.policies.provenance import package_versions, source_commit
from kinarm.problem import ReachProblem
from kinarm.problem_options import ProblemOptions
from kinarm.recording import Recording, record_rollouts
from kinarm.rollouts import Rollouts


@dataclass(frozen=True, eq=False)
class Run:
    """Trials as one policy ended them, to choose from by their positions.

    Attributes
    ----------
    numbers : sequence of int
        Numbers of the trials.
    ends : sequence of End
        How they ended.
    contacts : sequence
        The bodies that touched, per trial.
    recorded : callable
        From positions to recordings of these trials.
    """

    numbers: Sequence[int]
    ends: Sequence[End]
    contacts: Sequence[Pair | None]
    recorded: Callable[[Sequence[int]], list[Recording]]

    @classmethod
    def faced(
        cls, contestant: Contestant, trials: TrialSet, *, allow_other_arm: bool = False
    ) -> "Run":
        """Let a contestant face trials; those that are chosen become recordings.

        Parameters
        ----------
        contestant : Contestant
            Who faces them.
        trials : TrialSet
            The trials.
        allow_other_arm : bool
            Whether a policy may face an arm that it was not trained for.

        Raises
        ------
        PolicyFileError
            If it was trained for another arm and that is not allowed.
        """
        contestant.check(trials.simulator.arm, allow_other_arm=allow_other_arm)
        rollouts = contestant.run(trials, record=True)
        contacts = trials.simulator.contact_pairs(rollouts)
        recorded = partial(_recordings, contestant, trials, rollouts)
        return cls(range(len(rollouts)), ends_of(rollouts), contacts, recorded)

    @classmethod
    def of(cls, recordings: Sequence[Recording]) -> "Run":
        """Recordings of a file."""
        return cls(
            [each.trial for each in recordings],
            [
                (cast("Outcome", each.outcome), each.steps, each.final_distance)
                for each in recordings
            ],
            [each.contact for each in recordings],
            lambda positions: [recordings[position] for position in positions],
        )

    @property
    def causes(self) -> dict[int, Cause]:
        """Why trials failed, by the positions of those that did."""
        return failure_causes(self.ends, self.contacts)


def first_contestant(name: str | None, problem: ReachProblem | None = None) -> Contestant:
    """The contestant of a name; of a group, its first seed.

    Where the contestant does not say which problem it is for, it is this one.

    Raises
    ------
    InvalidInputError
        If none is named, or it does not exist.
    """
    if name is None:
        raise InvalidInputError("name a --policy, or a file of recordings or of an evaluation")
    return find_contestants(name, problem)[0]


def faced_problem(
    contestants: Sequence[Contestant], options: ProblemOptions, stated: ReachProblem | None
) -> ReachProblem:
    """The problem that is stated, or what options make of that of the first trained contestant.

    Parameters
    ----------
    contestants : sequence of Contestant
        Who faces it.
    options : ProblemOptions
        Changes to the problem.
    stated : ReachProblem, optional
        The problem, if one is named.

    Raises
    ------
    InvalidInputError
        If no contestant was trained and no option names a problem.
    """
    if stated is not None:
        return stated
    trained = [contestant.problem for contestant in contestants if contestant.problem is not None]
    if not trained:
        raise InvalidInputError(f"{contestants[0].name!r} was not trained: name a --problem")
    return options.resolve(trained[0])


def stated_problem(
    options: ProblemOptions, names: Sequence[str | None] = ()
) -> ReachProblem | None:
    """The problem that options name, if they name one.

    The best policy is for some problem: for the usual one if none is named.
    """
    named = options.problem is not None or options.task is not None
    return options.resolve() if named or BEST in names else None


def record(
    contestant: Contestant,
    trials: TrialSet,
    numbers: Sequence[int] | None = None,
    *,
    bounds: OracleSolutions | None = None,
    allow_other_arm: bool = False,
) -> list[Recording]:
    """Run a contestant on trials and record its motions, state by state.

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
    rollouts = contestant.run(trials, record=True)
    return _recordings(contestant, trials, rollouts, numbers, bounds)


def _recordings(
    contestant: Contestant,
    trials: TrialSet,
    rollouts: Rollouts,
    numbers: Sequence[int] | None = None,
    bounds: OracleSolutions | None = None,
) -> list[Recording]:
    """Rollouts that kept the configurations as recordings; else as `record`."""
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
