"""The worst trials of each policy, as a table whose rows choose what the replay shows."""

from collections.abc import Sequence
from typing import NamedTuple

from kinarm.evaluation.evaluations import Evaluation
from kinarm.evaluation.html_report.groups import Group, TaskResults
from kinarm.evaluation.html_report.maps import OUTCOMES
from kinarm.evaluation.html_report.markup import DASH, Markup, tag

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


def worst_table(task: TaskResults, chosen: Sequence[WorstTrial], first: int) -> Markup:
    """The chosen trials of a task.

    Parameters
    ----------
    task : TaskResults
        The task.
    chosen : sequence of WorstTrial
        What `worst_trials` returned.
    first : int
        Place of the first of them in the replay.
    """
    headings = [*HEADINGS, "oracle"] if task.entry["oracle"] else HEADINGS
    hidden = tag("span", "replay", class_="hidden")
    heads = [
        tag("th", text, scope="col", role="columnheader", title=MEANINGS.get(text))
        for text in (hidden, "policy", *headings)
    ]
    rows = [_row(task, worst, headings, first + place) for place, worst in enumerate(chosen)]
    return tag(
        "table",
        tag("caption", f"Task {task.name}"),
        tag("thead", tag("tr", heads, role="row"), role="rowgroup"),
        tag("tbody", rows, role="rowgroup"),
        class_="worst",
        role="table",
    )


HEADINGS = ("trial", "distance m", "outcome", "steps")
"""Columns beside the policy, the oracle's steps and the button."""

MEANINGS = {"oracle": "steps of the oracle's motion in the same trial"}

STYLES = {"outcome": "words"}


def _row(task: TaskResults, worst: WorstTrial, headings: Sequence[str], place: int) -> Markup:
    name, trial = worst.evaluation.entrant.name, worst.trial
    rollouts = worst.evaluation.rollouts
    figures = {
        "trial": f"{trial}",
        "distance m": f"{rollouts.distance[trial]:.3f}",
        "outcome": describe_outcome(worst),
        "steps": f"{rollouts.steps[trial]}",
        "oracle": _oracle_steps(task, trial),
    }
    button = tag("button", "▶", type="button", aria_label=f"Watch trial {trial} of {name}")
    return tag(
        "tr",
        tag("td", button, role="cell", class_="watch"),
        tag("th", tag("span", name), scope="row", role="rowheader"),
        [
            tag("td", figures[heading], role="cell", data_label=heading, class_=STYLES.get(heading))
            for heading in headings
        ],
        role="row",
        class_=worst.group.style,
        data_replay=str(place),
    )


def describe_outcome(worst: WorstTrial) -> str:
    """How a trial ended, and what touched what."""
    outcome = worst.evaluation.outcomes[worst.trial]
    pair = worst.evaluation.contacts[worst.trial]
    return f"{OUTCOMES[outcome]}: {pair[0]} {DASH} {pair[1]}" if pair else OUTCOMES[outcome]


def _oracle_steps(task: TaskResults, trial: int) -> str:
    """Steps of the oracle's motion, and how many are proven to be necessary if they are fewer."""
    if not task.entry["oracle"]:
        return ""
    bounds = task.entry["oracle"]["trials"]
    if not bounds["reachable"][trial]:
        return "not reached"
    steps, proven = bounds["steps"][trial], bounds["steps_lower_bound"][trial]
    return f"{steps}" if steps == proven else f"{steps}, proven ≥ {proven}"
