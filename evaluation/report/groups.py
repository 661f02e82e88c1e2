"""What the page shows as one: a policy, or all training seeds of a recipe."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm.arm import Arm
from kinarm.errors import InvalidInputError
from kinarm.evaluation.evaluation import Evaluation
from kinarm.evaluation.figures import series_label
from kinarm.evaluation.table import table_rows
from kinarm.scene import GoalRegion, Scene
from kinarm.task import ReachTask

COLOURS = 6
"""Colours of the style sheet for policies; beyond them, lines are dashed."""

DASHES = 4

UNTRAINED = ("baseline", "oracle")
"""Algorithms of the entrants that policies are compared with."""


@dataclass(frozen=True, eq=False)
class Group:
    """A row of the table, with the evaluations behind it.

    Attributes
    ----------
    row : dict
        The row, one of `kinarm.evaluation.table.table_rows`.
    members : tuple of Evaluation
        One per training seed.
    style : str
        Classes of the style sheet that give it its colour and dash.
    """

    row: dict[str, Any]
    members: tuple[Evaluation, ...]
    style: str

    @property
    def name(self) -> str:
        """Name in the table."""
        return str(self.row["policy"])

    @property
    def is_policy(self) -> bool:
        """Whether it is neither a baseline nor the oracle."""
        return self.row["algorithm"] not in UNTRAINED

    @cached_property
    def distances(self) -> NDArray[np.float64]:
        """Final distances [m], shape (n_seeds, n_trials)."""
        return np.stack([member.rollouts.distance for member in self.members])


@dataclass(frozen=True, eq=False)
class ProblemResults:
    """Everything about one problem.

    Attributes
    ----------
    name : str
        Name of the problem.
    entry : dict
        What the document's protocol says about it.
    groups : tuple of Group
        In the order of the table.
    """

    name: str
    entry: dict[str, Any]
    groups: tuple[Group, ...]

    @property
    def trials(self) -> int:
        """Number of trials."""
        return len(self.entry["goals"])

    @property
    def task(self) -> ReachTask:
        """Its goals and endings."""
        return self.groups[0].members[0].problem.task

    @property
    def arm(self) -> Arm:
        """What reaches."""
        return self.groups[0].members[0].trials.simulator.arm

    @property
    def tolerance(self) -> float:
        """Distance within which a goal is reached [m]."""
        return self.task.tolerance

    @property
    def oracle_rate(self) -> float | None:
        """Share of the trials that the oracle solved, if it was asked."""
        oracle = self.entry["oracle"]
        return float(oracle["success"]["value"]) if oracle else None

    @property
    def goal_regions(self) -> tuple[GoalRegion, ...]:
        """Where goals lie."""
        return tuple(self.scene.goal_region(name) for name in self.task.goal_regions)

    @property
    def scene(self) -> Scene:
        """What stands around."""
        return self.groups[0].members[0].problem.scene

    @property
    def pooled(self) -> bool:
        """Whether several training seeds share a row."""
        return any(len(group.members) > 1 for group in self.contenders)

    @property
    def contenders(self) -> tuple[Group, ...]:
        """The policies; where there are none, the baselines; else the oracle."""
        policies = tuple(group for group in self.groups if group.is_policy)
        others = tuple(group for group in self.groups if group.row["algorithm"] != "oracle")
        return policies or others or self.groups


def group_results(
    document: dict[str, Any], evaluations: Sequence[Evaluation]
) -> tuple[ProblemResults, ...]:
    """Bring the rows of the table together with the evaluations behind them.

    Parameters
    ----------
    document : dict
        What `evaluation_document` made of the evaluations.
    evaluations : sequence of Evaluation
        The evaluations.

    Raises
    ------
    InvalidInputError
        If the document was made of others.
    """
    known = {(each.entrant.name, each.problem.name): each for each in evaluations}
    if list(known) != [(row["policy"], row["problem"]) for row in document["results"]]:
        raise InvalidInputError("a report needs the document of the very evaluations that it shows")
    styles = _styles(evaluations)
    return tuple(
        ProblemResults(
            problem,
            entry,
            tuple(_group(row, known, styles) for row in table_rows(document, problem)),
        )
        for problem, entry in document["protocol"]["problems"].items()
    )


def _group(
    row: dict[str, Any], known: dict[tuple[str, str], Evaluation], styles: dict[str, str]
) -> Group:
    names = row.get("members", [row["policy"]])
    members = tuple(known[name, row["problem"]] for name in names)
    return Group(row, members, styles[series_label(members[0])])


def _styles(evaluations: Sequence[Evaluation]) -> dict[str, str]:
    """Classes by what the seeds and problems of a recipe share, in the order of appearance."""
    styles: dict[str, str] = {}
    policies = 0
    for evaluation in evaluations:
        label, entrant = series_label(evaluation), evaluation.entrant
        if label in styles:
            continue
        if entrant.algorithm in UNTRAINED:
            styles[label] = f"reference {entrant.name}"
        else:
            styles[label] = f"colour{policies % COLOURS} dash{policies // COLOURS % DASHES}"
            policies += 1
    return styles
