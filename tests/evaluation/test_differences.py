"""Policies less another in the same trials: figures, intervals, and trials that differ."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kinarm.errors import InvalidInputError
from kinarm.evaluation import EvaluationRequest
from kinarm.evaluation.estimates import estimate_metrics
from kinarm.evaluation.evaluation import evaluate, outcomes_of, run_trials
from kinarm.evaluation.metrics import METRICS
from kinarm.evaluation.statistics import contrast, share_difference
from kinarm.evaluation.summary import evaluation_document, pool
from kinarm.policies import ARSConfig, train_policy
from kinarm.problem import PROBLEMS
from kinarm.task import RewardWeights


def test_figures_are_subtracted_and_intervals_are_of_the_same_trials(evaluations):
    skilled, zero = evaluations[1], evaluations[3]
    found = skilled.difference(zero)
    assert list(found) == list(METRICS)
    for name in ("success", "collision", "mean_distance", "p95_distance", "mean_steps"):
        expected = skilled.metrics[name].value - zero.metrics[name].value
        assert found[name].value == pytest.approx(expected), name
    hits = [each.rollouts.success[None] for each in (skilled, zero)]
    assert found["success"] == share_difference(*hits)
    assert found["mean_steps"].ci95 is None
    other_way = zero.difference(skilled)
    for name in ("success", "mean_distance", "median_distance"):
        low, high = found[name].ci95
        assert low <= found[name].value <= high
        assert other_way[name].ci95 == pytest.approx((-high, -low), rel=1e-3)


def test_recipes_are_compared_over_seeds_and_trials(evaluations):
    (group,), one = pool(evaluations), evaluations[3]
    found = group.difference(one)
    hits = np.array([member.rollouts.success for member in group.members])
    assert found["success"] == share_difference(hits, one.rollouts.success[None])
    alone = group.members[1].difference(one)
    assert np.diff(found["mean_distance"].ci95) > np.diff(alone["mean_distance"].ci95)


def test_the_same_trainings_are_compared_one_by_one(evaluations):
    """What seeds differ in is common to both, as with and without a shield."""
    (group,) = pool(evaluations)
    members = [replace(each.contestant, source=Path(each.name)) for each in group.members]
    safe = [each.shielded() for each in members]
    sides = [
        pool([run_trials(each, evaluations[0].trials) for each in side])[0]
        for side in (safe, members)
    ]
    found, hits = sides[0].difference(sides[1]), [each.rollouts.success for each in group.members]
    kept = [each.rollouts.success for each in sides[0].members]
    paired = contrast([(1.0, np.subtract(kept, hits, dtype=float))]).ci95
    low, high = found["success"].ci95
    assert low <= paired[0] <= paired[1] <= high
    apart = share_difference(np.array(kept), np.array(hits)).ci95
    assert high - low < 0.5 * (apart[1] - apart[0])
    other = estimate_metrics(*(outcomes_of(side.members) for side in sides))
    assert other["success"].ci95 == apart
    for name in ("mean_distance", "median_distance"):
        assert found[name].value == other[name].value
        assert np.diff(found[name].ci95) < np.diff(other[name].ci95)


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"problem": "left"}, "task.goal_regions.*left.*right"),
        ({"tolerance": 0.03}, "task.tolerance is 0.03, not 0.05"),
        ({"seed": 1}, "seed is 1, not 0"),
        ({"trials": 6}, "there are 6 trials, not 5"),
    ],
)
def test_other_trials_are_refused_by_what_differs(changed, told):
    asked = {"problem": "right", "trials": 5, "seed": 0}
    first, second = (evaluate("zero", **each) for each in (asked, {**asked, **changed}))
    with pytest.raises(InvalidInputError, match=f"same trials, but in the second, {told}"):
        first.difference(second)


def test_a_reward_makes_no_other_trials():
    first, second = (
        evaluate("zero", "right", trials=3, **each)
        for each in ({}, {"reward": RewardWeights(success=9)})
    )
    assert first.problem.digest != second.problem.digest
    assert first.difference(second)["success"].value == 0


def test_what_is_seen_makes_no_other_trials():
    wide = PROBLEMS["right"].replace(observation=["goal", "position", "last_action"])
    first, second = (evaluate("zero", problem, trials=3) for problem in ("right", wide))
    assert first.trials.digest == second.trials.digest
    assert first.difference(second)["success"].value == 0


def test_policies_of_a_problem_that_see_different_things_are_compared(tmp_path):
    own = PROBLEMS["right"].replace(name="own", tolerance=0.2)
    for name, parts in (("one", ["goal", "position"]), ("two", ["goal", "orientation"])):
        problem = own.replace(observation=parts)
        config = ARSConfig(problem=problem, iterations=1, directions=1, top_directions=1)
        train_policy(config).policy.save(tmp_path / f"{name}.npz")
    names = tuple(str(tmp_path / f"{name}.npz") for name in ("one", "two"))
    document = EvaluationRequest(policies=names, trials=3, oracle=False).run()
    assert [(row.policy, row.problem) for row in document.results] == [
        ("one", "own"),
        ("two", "own"),
    ]
    (difference,) = document.differences
    assert {difference.policy, difference.reference} == {"one", "two"}
    for row, name in zip(document.results, names, strict=True):
        alone = evaluate(name, trials=3).rollouts.distance
        np.testing.assert_array_equal(row.outcomes.final_distance, alone)


def test_documents_hold_what_rows_have_less_the_reference(evaluations):
    document = evaluation_document(evaluations, "", "zero")
    (row,) = document.differences
    assert (row.policy, row.reference, row.problem) == ("made-right", "zero", "right")
    assert row.metrics == pool(evaluations)[0].difference(evaluations[3])
    (row,) = evaluation_document(evaluations, "", "made-right-seed2").differences
    assert (row.policy, row.reference) == ("zero", "made-right")
    assert not evaluation_document(evaluations, "").differences


def test_the_oracle_is_no_policy_that_is_compared(evaluations):
    oracle = evaluate("oracle", "right", trials=60, seed=5)
    compared = [*evaluations[1:4], oracle]
    document = evaluation_document(compared, "", "zero")
    assert [row.policy for row in document.differences] == ["made-right"]
    against = evaluation_document([replace(oracle), evaluations[3]], "", "oracle").differences
    assert [(row.policy, row.reference) for row in against] == [("zero", "oracle")]
