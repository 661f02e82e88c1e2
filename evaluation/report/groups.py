"""Groups of a report, a policy or training seeds each, and worst trials."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.errors import InvalidInputError
from kinarm.evaluation.contestants import UNTRAINED, Contestant
from kinarm.evaluation.document import EvaluationDocument, FacedProblem, PooledResult, Row
from kinarm.evaluation.evaluation import Evaluation
from kinarm.evaluation.replay import record
from kinarm.evaluation.selection import group_names
from kinarm.evaluation.table import table_rows
from kinarm.evaluation.trials import TrialSet
from kinarm.recording import Recording
from kinarm.scene import GoalRegion

PAGE_COLOURS, PAGE_DASHES = 6, 4
"""Colours and dashes of the style sheet for policies."""

BEST_GROUPS, TRIALS, AT_LEAST = 4, 9, 3
"""Groups with worst trials, trials that they share, and the least each."""


@dataclass(frozen=True, eq=False)
class Group:
    """A row of the table, its evaluations by training seed, and its style.

    The style names classes of the style sheet.
    """

    row: Row
    members: tuple[Evaluation, ...]
    style: str

    @property
    def name(self) -> str:
        """Name in the table."""
        return self.row.policy

    @property
    def is_policy(self) -> bool:
        """Whether it is neither a baseline nor the oracle."""
        return self.row.algorithm not in ("baseline", "oracle")

    @cached_property
    def distances(self) -> NDArray[np.float64]:
        """Final distances [m], shape (n_seeds, n_trials)."""
        return np.stack([member.rollouts.distance for member in self.members])

    @cached_property
    def success(self) -> NDArray[np.bool_]:
        """Whether trials succeeded, shape (n_seeds, n_trials)."""
        return np.stack([member.rollouts.success for member in self.members])


@dataclass(frozen=True, eq=False)
class ProblemResults:
    """A problem, its entry in the protocol, and its groups as in the table."""

    name: str
    entry: FacedProblem
    groups: tuple[Group, ...]

    @property
    def trials(self) -> TrialSet:
        """The trials that were faced."""
        return self.groups[0].members[0].trials

    @property
    def tolerance(self) -> float:
        """Distance within which a goal is reached [m]."""
        return self.trials.problem.task.tolerance

    @property
    def oracle_rate(self) -> float | None:
        """Share of trials that the oracle solved, if asked."""
        return self.entry.oracle.success.value if self.entry.oracle else None

    @property
    def goal_regions(self) -> tuple[GoalRegion, ...]:
        """Where goals lie."""
        problem = self.trials.problem
        return tuple(problem.scene.goal_region(name) for name in problem.task.goal_regions)

    @property
    def contenders(self) -> tuple[Group, ...]:
        """The policies, best first; without any, the baselines; else the oracle."""
        policies = tuple(group for group in self.groups if group.is_policy)
        others = tuple(group for group in self.groups if group.row.algorithm != "oracle")
        return policies or others or self.groups


def group_results(
    document: EvaluationDocument, evaluations: Sequence[Evaluation]
) -> tuple[ProblemResults, ...]:
    """Bring the rows of the table together with their evaluations."""
    known = {(each.contestant.name, each.problem.name): each for each in evaluations}
    if list(known) != [(row.policy, row.problem) for row in document.results]:
        raise InvalidInputError("a report needs the document of the very evaluations that it shows")
    labels = group_names(each.contestant for each in evaluations)
    styles = _styles({labels[each.contestant.name]: each.contestant for each in evaluations})
    found = []
    for problem, entry in document.protocol.problems.items():
        groups = []
        for row in table_rows(document, problem):
            names = row.members if isinstance(row, PooledResult) else [row.policy]
            members = tuple(known[name, problem] for name in names)
            groups.append(Group(row, members, styles[labels[names[0]]]))
        found.append(ProblemResults(problem, entry, tuple(groups)))
    return tuple(found)


def _styles(contestants: Mapping[str, Contestant]) -> dict[str, str]:
    """Classes by label, in the order of appearance."""
    styles = {label: f"reference {each.name}" for label, each in contestants.items()}
    trained = (k for k, each in contestants.items() if each not in UNTRAINED.values())
    for number, label in enumerate(trained):
        dash, colour = divmod(number, PAGE_COLOURS)
        styles[label] = f"colour{colour} dash{dash % PAGE_DASHES}"
    return styles


class WorstTrial(NamedTuple):
    """A bad trial: its group, its training seed's evaluation, and its number."""

    group: Group
    evaluation: Evaluation
    trial: int


def worst_trials(results: ProblemResults) -> tuple[WorstTrial, ...]:
    """The worst trials of a problem's best groups: failures first, the farthest first.

    No trial is there twice: a better group, which has fewer failures, chooses first.
    """
    groups = results.contenders[:BEST_GROUPS]
    share = max(AT_LEAST, TRIALS // len(groups))
    found: dict[int, WorstTrial] = {}
    for group in groups:
        others = (worst for worst in _ranked(group) if worst.trial not in found)
        found |= {worst.trial: worst for worst in islice(others, share)}
    return tuple(found.values())


def _ranked(group: Group) -> list[WorstTrial]:
    """Each trial of a group by its worst training seed, the worst first."""
    order = np.lexsort((-group.distances.ravel(), group.success.ravel())).tolist()
    found: dict[int, WorstTrial] = {}
    for place in order:
        seed, trial = divmod(place, group.success.shape[1])
        found.setdefault(trial, WorstTrial(group, group.members[seed], trial))
    return list(found.values())


def record_worst(chosen: Sequence[WorstTrial]) -> list[Recording]:
    """Run the trials again, and record each."""
    recordings = {}
    for each in dict.fromkeys(worst.evaluation for worst in chosen):
        trials = [worst.trial for worst in chosen if worst.evaluation is each]
        # Whether a policy may face another arm was checked when the evaluation was made.
        contestant, known = each.contestant, each.bounds
        made = record(contestant, each.trials, trials, bounds=known, allow_other_arm=True)
        recordings.update({(each, recording.trial): recording for recording in made})
    return [recordings[worst.evaluation, worst.trial] for worst in chosen]
