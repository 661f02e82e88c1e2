"""Causes of failures, against a count of what the document says of every trial."""

from collections import Counter

import numpy as np
import pytest

from kinarm.evaluation.outcomes import Cause, failure_causes
from kinarm.evaluation.summary import pool


def counted(rows):
    """Failures by cause: bodies that touch and whether early, from the outcomes of rows."""
    counts = Counter()
    for row in rows:
        columns = (row["outcomes"][name] for name in ("outcome", "contact", "steps"))
        for outcome, contact, steps in zip(*columns, strict=True):
            if outcome == "collision":
                counts[tuple(contact), steps < 4] += 1
            elif outcome == "truncated":
                counts[None, False] += 1
    return counts


def told(row):
    return {
        (each["contact"] and tuple(each["contact"]), each["early"]): each["trials"]
        for each in row["failures"]
    }


def test_failures_are_counted_by_cause(evaluations):
    rows = [evaluation.result.to_json() for evaluation in evaluations]
    for row in rows:
        assert told(row) == dict(counted([row]))
        numbers = [each["trials"] for each in row["failures"]]
        assert numbers == sorted(numbers, reverse=True)
        shares = [each["share_of_failures"] for each in row["failures"]]
        assert sum(shares) == pytest.approx(float(bool(shares)))
    pooled = pool(evaluations)[0].result.to_json()
    assert told(pooled) == dict(counted(rows[:3]))


def test_shares_of_trials_are_those_of_the_causes(evaluations):
    for evaluation in evaluations:
        row, metrics = evaluation.result.to_json(), evaluation.metrics
        early = sum(each["trials"] for each in row["failures"] if each["early"])
        assert metrics["early_collision"].value == early / row["trials"]
        late = metrics["collision"].value - metrics["early_collision"].value
        truncated = np.mean([outcome == "truncated" for outcome in evaluation.rollouts.outcomes])
        assert metrics["truncated"].value == truncated
        assert metrics["success"].value + early / row["trials"] + late + truncated == pytest.approx(
            1
        )


def test_early_is_within_the_first_steps():
    pair = ("hand", "bench")
    outcomes = ("collision", "collision", "success", "truncated")
    assert failure_causes(outcomes, (3, 4, 3, 3), (pair, pair, None, None)) == {
        0: Cause(pair, True),
        1: Cause(pair, False),
        3: Cause(None, False),
    }
