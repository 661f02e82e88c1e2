"""The worst trials of each policy, which the page lists and replays."""

from collections.abc import Sequence
from itertools import islice
from typing import Any, NamedTuple

from kinarm.evaluation.bounds import TrialBounds
from kinarm.evaluation.evaluation import Evaluation
from kinarm.evaluation.replay.runs import record
from kinarm.evaluation.report.groups import Group, ProblemResults
from kinarm.evaluation.report.maps import OUTCOME_WORDS
from kinarm.recording import Recording

BEST_GROUPS = 4
"""Groups of a problem whose worst trials are shown."""

TRIALS = 9
"""Trials that the groups of a problem share, but at least `AT_LEAST` each."""

AT_LEAST = 3


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
    ranked = sorted(
        (bool(success), -float(distance), seed, trial)
        for seed, member in enumerate(group.members)
        for trial, (success, distance) in enumerate(
            zip(member.rollouts.success, member.rollouts.distance, strict=True)
        )
    )
    found: dict[int, WorstTrial] = {}
    for *_, seed, trial in ranked:
        found.setdefault(trial, WorstTrial(group, group.members[seed], trial))
    return list(found.values())


def worst_row(results: ProblemResults, worst: WorstTrial) -> dict[str, Any]:
    """Row of the page about a trial: its policy, and figures by their headings."""
    rollouts, trial = worst.evaluation.rollouts, worst.trial
    figures = {
        "trial": f"{trial}",
        "distance m": f"{rollouts.distance[trial]:.3f}",
        "outcome": describe_outcome(worst),
        "steps": f"{rollouts.steps[trial]}",
    }
    if results.entry.oracle:
        figures["oracle steps"] = oracle_steps(results.entry.oracle.trials, trial)
    return {
        "policy": worst.evaluation.contestant.name,
        "style": worst.group.style,
        "trial": trial,
        "figures": figures,
    }


def describe_outcome(worst: WorstTrial) -> str:
    """How a trial ended, and what touched what."""
    outcome = worst.evaluation.outcomes[worst.trial]
    pair = worst.evaluation.contacts[worst.trial]
    return (
        f"{OUTCOME_WORDS[outcome]}: {pair[0]} \N{EN DASH} {pair[1]}"
        if pair
        else OUTCOME_WORDS[outcome]
    )


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
    numbers: dict[Evaluation, list[int]] = {}
    for worst in chosen:
        numbers.setdefault(worst.evaluation, []).append(worst.trial)
    recordings = {}
    for each, trials in numbers.items():
        # Whether a policy may face another arm was checked when the evaluation was made.
        options: dict[str, Any] = {"bounds": each.bounds, "allow_other_arm": True}
        for recording in record(each.contestant, each.trials, trials, **options):
            recordings[each, recording.trial] = recording
    return [recordings[worst.evaluation, worst.trial] for worst in chosen]
