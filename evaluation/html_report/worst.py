"""The worst trials of each policy, as a table whose rows choose what the replay shows."""

from collections.abc import Sequence
from typing import NamedTuple

from kinarm.evaluation.evaluations import Evaluation
from kinarm.evaluation.html_report.groups import Group, TaskResults
from kinarm.evaluation.html_report.maps import OUTCOMES
from kinarm.evaluation.html_report.markup import DASH, Markup, tag
from kinarm.evaluation.html_report.profiles import swatch

BEST_GROUPS = 4
"""Groups of a task whose worst trials are shown."""

TRIALS = 9
"""Trials that the groups of a task share, but at least `AT_LEAST` each."""

AT_LEAST = 3


class WorstTrial(NamedTuple):
    """A trial that went badly.

    Attributes
    ----------
    group : Group
        Whose it was.
    evaluation : Evaluation
        Which training seed's.
    trial : int
        Its number.
    """

    group: Group
    evaluation: Evaluation
    trial: int


def worst_trials(task: TaskResults) -> tuple[WorstTrial, ...]:
    """Choose the worst trials of the best groups of a task: failures first, the farthest first.

    Parameters
    ----------
    task : TaskResults
        The task.
    """
    groups = task.contenders[:BEST_GROUPS]
    share = max(AT_LEAST, TRIALS // len(groups))
    return tuple(found for group in groups for found in _worst_of(group, share))


def _worst_of(group: Group, count: int) -> list[WorstTrial]:
    ranked = sorted(
        (bool(success), -float(distance), seed, trial)
        for seed, member in enumerate(group.members)
        for trial, (success, distance) in enumerate(
            zip(member.rollouts.success, member.rollouts.distance, strict=True)
        )
    )
    return [WorstTrial(group, group.members[seed], trial) for *_, seed, trial in ranked[:count]]


def worst_table(task: TaskResults, chosen: Sequence[WorstTrial], first: int | None) -> Markup:
    """The chosen trials of a task.

    Parameters
    ----------
    task : TaskResults
        The task.
    chosen : sequence of WorstTrial
        What `worst_trials` returned.
    first : int or None
        Place of the first of them in the replay; None if there is no replay.
    """
    headings = ["policy", "trial", "distance m", "outcome", "steps", "oracle's steps"]
    if not task.entry["oracle"]:
        headings.pop()
    if first is not None:
        headings.append("replay")
    heads = [tag("th", heading, scope="col", role="columnheader") for heading in headings]
    rows = [
        _row(task, worst, headings, None if first is None else first + place)
        for place, worst in enumerate(chosen)
    ]
    return tag(
        "table",
        tag("caption", f"Worst trials on {task.name}"),
        tag("thead", tag("tr", heads, role="row"), role="rowgroup"),
        tag("tbody", rows, role="rowgroup"),
        class_="worst",
        role="table",
    )


def _row(
    task: TaskResults, worst: WorstTrial, headings: Sequence[str], place: int | None
) -> Markup:
    name = worst.evaluation.entrant.name
    rollouts, trial = worst.evaluation.rollouts, worst.trial
    cells = (
        f"{trial}",
        f"{rollouts.distance[trial]:.3f}",
        describe_outcome(worst),
        f"{rollouts.steps[trial]}",
        _oracle_steps(task, trial),
        _button(name, trial, place),
    )
    figures = zip(headings[1:], (cell for cell in cells if cell is not None), strict=True)
    return tag(
        "tr",
        tag("th", swatch(worst.group), tag("span", name), scope="row", role="rowheader"),
        [
            tag("td", cell, role="cell", data_label=heading, class_=CLASSES.get(heading))
            for heading, cell in figures
        ],
        role="row",
        data_replay=None if place is None else str(place),
    )


CLASSES = {"outcome": "words", "replay": "watch"}


def describe_outcome(worst: WorstTrial) -> str:
    """How a trial ended, and what touched what."""
    outcome = worst.evaluation.outcomes[worst.trial]
    pair = worst.evaluation.contacts[worst.trial]
    return f"{OUTCOMES[outcome]}: {pair[0]} {DASH} {pair[1]}" if pair else OUTCOMES[outcome]


def _oracle_steps(task: TaskResults, trial: int) -> str | None:
    """Steps of the oracle's motion, and how many are proven to be necessary if they are fewer."""
    if not task.entry["oracle"]:
        return None
    bounds = task.entry["oracle"]["trials"]
    if not bounds["reachable"][trial]:
        return "not reached"
    steps, proven = bounds["steps"][trial], bounds["steps_lower_bound"][trial]
    return f"{steps}" if steps == proven else f"{steps}, proven ≥ {proven}"


def _button(name: str, trial: int, place: int | None) -> Markup | None:
    if place is None:
        return None
    label = f"Watch trial {trial} of {name}"
    return tag("button", "▶ Watch", type="button", aria_label=label, data_replay=str(place))
