"""Causes of failures, against a count of what the document says of every trial."""

from collections import Counter

import numpy as np
import pytest

from kinarm.evaluation.evaluation import pool
from kinarm.evaluation.outcomes import Cause, failure_causes


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
    rows = [evaluation.to_json() for evaluation in evaluations]
    for row in rows:
        assert told(row) == dict(counted([row]))
        numbers = [each["trials"] for each in row["failures"]]
        assert numbers == sorted(numbers, reverse=True)
        shares = [each["share_of_failures"] for each in row["failures"]]
        assert sum(shares) == pytest.approx(float(bool(shares)))
    pooled = pool(evaluations)[0].to_json()
    assert told(pooled) == dict(counted(rows[:3]))


def test_shares_of_trials_are_those_of_the_causes(evaluations):
    for evaluation in evaluations:
        row, metrics = evaluation.to_json(), evaluation.metrics
        early = sum(each["trials"] for each in row["failures"] if each["early"])
        assert metrics["early_collision"].value == early / row["trials"]
        late = metrics["collision"].value - metrics["early_collision"].value
        truncated = np.mean([outcome == "truncated" for outcome in evaluation.outcomes])
        assert metrics["truncated"].value == truncated
        assert metrics["success"].value + early / row["trials"] + late + truncated == pytest.approx(
            1
        )


def test_time_to_reach_is_of_the_trials_that_succeeded(skilled_evaluation):
    steps = skilled_evaluation.rollouts.steps[skilled_evaluation.rollouts.success]
    assert skilled_evaluation.metrics["steps_to_success"].value == np.median(steps)
    assert skilled_evaluation.metrics["time_to_success"].value == 0.02 * np.median(steps)


def test_the_worst_seed_is_named(evaluations):
    rates = {each.contestant.name: each.success.value for each in evaluations[:3]}
    worst = pool(evaluations)[0].to_json()["worst_seed"]
    assert rates[worst["policy"]] == worst["success"]["value"] == min(rates.values())


def test_causes_read_as_words():
    assert str(Cause(("hand", "bench"), True)) == "hand touches bench within 3 steps"
    assert str(Cause(("hand", "bench"), False)) == "hand touches bench after 3 steps"
    assert str(Cause(None, False)) == "truncated"


def test_early_is_within_the_first_steps():
    pair = ("hand", "bench")
    ends = [("collision", 3, 0.1), ("collision", 4, 0.1), ("success", 3, 0.0), ("truncated", 3, 1)]
    assert failure_causes(ends, [pair, pair, None, None]) == {
        0: Cause(pair, True),
        1: Cause(pair, False),
        3: Cause(None, False),
    }
