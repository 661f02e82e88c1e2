"""The worst trials of each policy, which the page lists and replays."""

from collections.abc import Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np

from kinarm.evaluation.bounds import TrialBounds
from kinarm.evaluation.evaluation import Evaluation
from kinarm.evaluation.replay.runs import record
from kinarm.evaluation.report.groups import Group, ProblemResults
from kinarm.recording import Recording

BEST_GROUPS, TRIALS, AT_LEAST = 4, 9, 3
"""Groups of a problem whose worst trials are shown, trials that they share, and the least each."""


class WorstTrial(NamedTuple):
    """A trial that went badly: whose it was, of which training seed, and its number."""

    group: Group
    evaluation: Evaluation
    trial: int


def worst_trials(results: ProblemResults) -> tuple[WorstTrial, ...]:
    """The worst trials of the best groups of a problem: failures first, the farthest first.

    No trial is there twice: that of a better group, which has fewer failures, goes first.
    """
    groups = results.contenders[:BEST_GROUPS]
    share = max(AT_LEAST, TRIALS // len(groups))
    found: dict[int, WorstTrial] = {}
    for group in groups:
        others = (worst for worst in _ranked(group) if worst.trial not in found)
        found |= {worst.trial: worst for worst in islice(others, share)}
    return tuple(found.values())


def _ranked(group: Group) -> list[WorstTrial]:
    """Each trial of a group by the training seed that does worst in it, the worst first."""
    order = np.lexsort((-group.distances.ravel(), group.success.ravel())).tolist()
    found: dict[int, WorstTrial] = {}
    for place in order:
        seed, trial = divmod(place, group.success.shape[1])
        found.setdefault(trial, WorstTrial(group, group.members[seed], trial))
    return list(found.values())


def oracle_steps(bounds: TrialBounds, trial: int) -> str:
    """Steps of the oracle's motion, and how many are proven to be necessary if they are fewer."""
    if trial >= len(bounds.reachable):
        return "not asked"
    if not bounds.reachable[trial]:
        return "not reached"
    steps, proven = bounds.steps[trial], bounds.steps_lower_bound[trial]
    return f"{steps}" if steps == proven else f"{steps}, proven ≥ {proven}"


def record_worst(chosen: Sequence[WorstTrial]) -> list[Recording]:
    """Run policies on the trials again: one recording for each."""
    recordings = {}
    for each in dict.fromkeys(worst.evaluation for worst in chosen):
        trials = [worst.trial for worst in chosen if worst.evaluation is each]
        # Whether a policy may face another arm was checked when the evaluation was made.
        contestant, known = each.contestant, each.bounds
        made = record(contestant, each.trials, trials, bounds=known, allow_other_arm=True)
        recordings.update({(each, recording.trial): recording for recording in made})
    return [recordings[worst.evaluation, worst.trial] for worst in chosen]
