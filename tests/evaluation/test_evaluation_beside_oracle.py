"""Evaluations beside the oracle: what compares with it, and that it is asked once."""

from dataclasses import replace

import numpy as np
import pytest

from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.evaluation import evaluate, outcomes_of, run_trials
from kinarm.evaluation.finding import find_contestants
from kinarm.evaluation.summary import pool
from kinarm.policies.oracle import Oracle

COMPARED = ("relative_success", "step_ratio", "step_ratio_p95")


def oracle_figures(evaluation):
    """Figures that compare with the oracle, in documents."""
    return [evaluation.result.to_json()["metrics"][name]["value"] for name in COMPARED]


def test_step_ratio_is_that_of_the_trials_that_succeeded(bounded):
    rollouts, starts, goals = bounded.rollouts, bounded.trials.starts, bounded.trials.goals
    solutions = Oracle("right").solve_batch(starts, goals)
    expected = [
        rollouts.steps[trial] / solutions.steps_lower_bound[trial]
        for trial in range(len(solutions))
        if rollouts.success[trial]
    ]
    assert 0 < len(expected) < 60
    assert outcomes_of((bounded,)).step_ratio.tolist() == expected
    assert bounded.metrics["step_ratio"].value == np.median(expected)
    assert bounded.metrics["step_ratio_p95"].value == np.percentile(expected, 95)


@pytest.mark.parametrize("reached", [range(60), range(0, 60, 3), [7]])
def test_relative_success_is_the_ratio_of_two_rates(bounded, reached):
    reachable = np.isin(np.arange(60), list(reached))
    made = replace(bounded, bounds=replace(bounded.bounds, reachable=reachable))
    successes, possible = bounded.rollouts.outcomes.count("success"), len(reached)
    relative = made.metrics["relative_success"].value
    assert relative == pytest.approx((successes / 60) / (possible / 60))


def test_a_policy_that_never_succeeds_has_no_step_ratio():
    evaluation = evaluate("zero", "right", trials=4, oracle=True)
    assert oracle_figures(evaluation) == [0, None, None]


@pytest.mark.parametrize("name", ["oracle", "zero"])
def test_where_the_oracle_reaches_nothing_there_is_nothing_to_compare_with(name):
    evaluation = evaluate(name, "right", horizon=1, trials=4, oracle=True)
    assert not evaluation.bounds.reachable.any()
    assert oracle_figures(evaluation) == [None, None, None]


def test_the_oracle_changes_nothing_but_the_bounds(skilled_evaluation, bounded):
    alone, beside = skilled_evaluation.result.to_json(), bounded.result.to_json()
    for name in COMPARED:
        assert alone["metrics"].pop(name) == {"value": None, "ci95": None}
        assert beside["metrics"].pop(name)["value"] is not None
    assert alone == beside


@pytest.mark.parametrize(
    ("arm", "name", "task"),
    [
        ("paper", "ars-tuned-both-seed0", "both"),
        ("paper", "random", "left"),
        ("paper", "oracle", "both"),
        ("paper_flange", "oracle", "right"),
        ("lrmate200ic_5l", "oracle", "right"),
    ],
)
def test_nobody_is_better_than_proven_possible(arm, name, task):
    evaluation = evaluate(name, task, trials=25, seed=2, arm=arm, oracle=True)
    assert (outcomes_of((evaluation,)).step_ratio >= 1).all()
    rollouts, bounds = evaluation.rollouts, evaluation.bounds
    assert not rollouts.success[bounds.steps_lower_bound > 64].any()


def test_pooled_step_ratio_is_over_all_seeds(trials):
    members = [
        run_trials(e, trials, bounds=oracle_bounds(trials))
        for e in find_contestants("ars-tuned-both")
    ]
    relative, median, p95 = oracle_figures(pool(members)[0])
    ratios = [
        member.rollouts.steps[trial] / member.bounds.steps_lower_bound[trial]
        for member in members
        for trial in np.flatnonzero(member.rollouts.success)
    ]
    faced = len(members) * len(trials)
    assert 0.25 < len(ratios) / faced < 1
    assert median == pytest.approx(np.median(ratios))
    assert p95 == pytest.approx(np.percentile(ratios, 95))
    assert relative == pytest.approx(len(ratios) / faced)
