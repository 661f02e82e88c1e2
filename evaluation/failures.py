"""Why trials fail: what touched, and how early, or that the steps ran out."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from kinarm.evaluation.outcomes import EARLY_STEPS, is_early
from kinarm.rollouts import Rollouts

Pair = tuple[str, str]


class Cause(NamedTuple):
    """Why a trial failed.

    Attributes
    ----------
    pair : tuple of str, or None
        The bodies that touched; None where the steps ran out.
    early : bool
        Whether they did within the first `EARLY_STEPS` steps.
    """

    pair: Pair | None
    early: bool

    def __str__(self) -> str:
        if self.pair is None:
            return "truncated"
        when = f"within {EARLY_STEPS} steps" if self.early else f"after {EARLY_STEPS} steps"
        return f"{self.pair[0]} touches {self.pair[1]} {when}"


def failure_causes(rollouts: Rollouts, contacts: Sequence[Pair | None]) -> dict[int, Cause]:
    """Causes of the trials that failed, by their numbers.

    Parameters
    ----------
    rollouts : Rollouts
        What was done.
    contacts : sequence
        The bodies that touched, per trial, as `Simulator.contact_pairs` names them.
    """
    early = is_early(rollouts.collision, rollouts.steps)
    return {
        trial: Cause(contacts[trial], bool(early[trial]))
        for trial in np.flatnonzero(~rollouts.success).tolist()
    }


def failure_rows(members: Sequence[tuple[Rollouts, Sequence[Pair | None]]]) -> list[dict[str, Any]]:
    """How many trials failed for each cause, the most frequent first, in terms of JSON.

    Parameters
    ----------
    members : sequence of (Rollouts, contacts)
        What one or several training seeds did, as for `failure_causes`; their counts are added.
    """
    counts = Counter(cause for each in members for cause in failure_causes(*each).values())
    failed = sum(counts.values())
    return [
        {
            "contact": list(cause.pair) if cause.pair else None,
            "early": cause.early,
            "trials": count,
            "share_of_failures": count / failed,
        }
        for cause, count in sorted(counts.items(), key=lambda item: (-item[1], str(item[0])))
    ]


def cause_words(row: Mapping[str, Any]) -> str:
    """The cause of one of the `failure_rows`, in words."""
    return str(Cause(row["contact"] and tuple(row["contact"]), row["early"]))
