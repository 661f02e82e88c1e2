"""Evaluations: their figures against the episodes."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from reseeded import reseeded

from kinarm.arm import Arm
from kinarm.errors import InvalidInputError, PolicyFileError
from kinarm.evaluation.contestants import Contestant
from kinarm.evaluation.evaluation import evaluate
from kinarm.evaluation.summary import pool
from kinarm.policies.oracle import Oracle


def test_figures_are_those_of_the_episodes(skilled_evaluation):
    distance = np.array(skilled_evaluation.rollouts.distance)
    outcomes = skilled_evaluation.rollouts.outcomes
    document = skilled_evaluation.result.to_json()
    figures = {name: entry["value"] for name, entry in document["metrics"].items()}
    assert document["trials"] == 60
    assert figures["success"] == outcomes.count("success") / 60
    assert figures["collision"] == outcomes.count("collision") / 60
    assert figures["within_0.1"] == sum(distance <= 0.1) / 60
    assert figures["within_0.2"] == sum(distance <= 0.2) / 60
    assert figures["mean_distance"] == pytest.approx(sum(distance) / 60)
    assert figures["max_distance"] == max(distance)
    assert figures["mean_steps"] == pytest.approx(sum(skilled_evaluation.rollouts.steps) / 60)


def test_it_can_be_pickled_for_other_processes(skilled_evaluation):
    copy = pickle.loads(pickle.dumps(skilled_evaluation))
    assert copy.metrics == skilled_evaluation.metrics
    np.testing.assert_array_equal(copy.rollouts.distance, skilled_evaluation.rollouts.distance)


def test_the_still_baseline_never_moves():
    evaluation = evaluate("zero", "both", trials=30, seed=2)
    rollouts, arm = evaluation.rollouts, Arm.load()
    np.testing.assert_array_equal(rollouts.configurations, evaluation.trials.starts)
    assert set(evaluation.rollouts.outcomes) == {"truncated"}
    assert (rollouts.steps == 64).all()
    tools = np.array([arm.tool_position(start) for start in evaluation.trials.starts])
    expected = np.linalg.norm(tools - evaluation.trials.goals, axis=1)
    np.testing.assert_allclose(rollouts.distance, expected, atol=1e-12)


def test_the_random_baseline_is_reproducible_and_independent_of_the_number_of_trials():
    few, many = (evaluate("random", "right", trials=n, seed=1) for n in (6, 25))
    again = evaluate("random", "right", trials=25, seed=1)
    np.testing.assert_array_equal(many.rollouts.configurations, again.rollouts.configurations)
    np.testing.assert_array_equal(many.rollouts.configurations[:6], few.rollouts.configurations)
    np.testing.assert_array_equal(many.rollouts.steps[:6], few.rollouts.steps)


def test_the_random_baseline_moves_differently_in_every_trial_and_seed():
    one, other = (evaluate("random", "right", trials=20, seed=seed) for seed in (1, 2))
    moves = np.concatenate(
        [e.rollouts.configurations[:, :5] - e.trials.starts[:, :5] for e in (one, other)]
    )
    moved = moves[moves.any(axis=1)]
    assert len(moved) > 30
    assert len(np.unique(moved.round(9), axis=0)) == len(moved)


def test_a_policy_faces_its_own_problem_by_default(train_novice):
    assert evaluate(train_novice("left"), trials=2).problem.name == "left"
    assert evaluate(train_novice("left"), "right", trials=2).problem.name == "right"


def test_a_function_does_as_the_policy_in_it_does(skilled):
    def wrapped(observations):
        return skilled(observations)

    function, compiled = (evaluate(p, "right", trials=40) for p in (wrapped, skilled))
    assert (function.contestant.name, function.contestant.policy) == ("wrapped", None)
    np.testing.assert_array_equal(function.rollouts.steps, compiled.rollouts.steps)
    np.testing.assert_allclose(function.rollouts.distance, compiled.rollouts.distance, atol=1e-9)


@pytest.mark.parametrize("actions", [np.zeros(5), np.full((3, 5), np.nan), "left", None])
def test_a_function_with_bad_actions_is_refused(actions):
    with pytest.raises(InvalidInputError, match="actions must"):
        evaluate(lambda _: actions, "right", trials=3)


def test_a_policy_for_another_arm_is_refused_unless_allowed(skilled):
    with pytest.raises(PolicyFileError, match=r"trained for arm 'paper', not for 'paper_flange'"):
        evaluate(skilled, arm="paper_flange", trials=2)
    allowed = evaluate(skilled, arm="paper_flange", trials=2, allow_other_arm=True)
    assert allowed.trials.simulator.arm.name == "paper_flange"


def test_pooling_keeps_problems_apart(skilled):
    contestants = [
        Contestant.from_policy(f"mine-seed{seed}", reseeded(skilled, seed)) for seed in (0, 1)
    ]
    made = [evaluate(e, task, trials=2) for e in contestants for task in ("left", "right")]
    assert [(p.name, p.problem.name, len(p.members)) for p in pool(made)] == [
        ("mine", "left", 2),
        ("mine", "right", 2),
    ]


def test_pooling_keeps_other_settings_apart(skilled):
    """Policies that are objects are called alike, whatever their settings."""
    seeds = [reseeded(skilled, seed) for seed in (0, 1)]
    settings = {**skilled.provenance.config, "step_size": 9.0}
    other = replace(skilled, provenance=replace(skilled.provenance, config=settings, seed=2))
    made = [evaluate(each, trials=2) for each in (*seeds, other)]
    assert len({each.name for each in made}) == 1
    assert [group.members for group in pool(made)] == [tuple(made[:2])]


def test_pooling_keeps_other_trials_apart(evaluations):
    first, *_ = pool(evaluations)[0].members
    others = [replace(each, trials=each.trials.first(50)) for each in evaluations]
    (group,) = pool([first, *(each for each in others if each.name != first.name)])
    assert [len(each.trials) for each in group.members] == [50, 50]
    assert first.name not in {each.name for each in group.members}


def test_pooled_figures_are_those_of_all_seeds(evaluations):
    members = evaluations[:3]
    document = pool(evaluations)[0].result.to_json()
    figures = {name: entry["value"] for name, entry in document["metrics"].items()}
    distance = np.concatenate([member.rollouts.distance for member in members])
    steps = np.concatenate([member.rollouts.steps for member in members])
    assert document["trials"] == 60
    assert figures["mean_distance"] == pytest.approx(distance.mean())
    assert figures["median_distance"] == pytest.approx(np.median(distance))
    assert figures["max_distance"] == distance.max()
    assert figures["success"] == pytest.approx(np.mean(distance <= 0.05))
    assert figures["within_0.2"] == pytest.approx(np.mean(distance <= 0.2))
    assert figures["mean_steps"] == pytest.approx(steps.mean())
    assert figures["median_steps"] == np.median(steps)


def test_pooled_spread_is_over_the_seeds(evaluations):
    pooled = pool(evaluations)[0]
    rates = [member.success.value for member in evaluations[:3]]
    medians = [sorted(member.rollouts.distance)[29:31] for member in evaluations[:3]]
    spread = pooled.result.to_json()["spread"]
    assert spread["success"]["each"] == rates
    assert (spread["success"]["min"], spread["success"]["max"]) == (min(rates), max(rates))
    mean = sum(rates) / 3
    deviation = (sum((rate - mean) ** 2 for rate in rates) / 2) ** 0.5
    assert spread["success"]["std"] == pytest.approx(deviation)
    assert spread["median_distance"]["each"] == pytest.approx([sum(m) / 2 for m in medians])
    assert not {"step_ratio", "relative_success"} & set(spread)


def test_pooled_interval_is_no_narrower_than_its_trials_allow(evaluations):
    """60 trials with the pooled rate have a Wilson interval at least this wide."""
    success = pool(evaluations)[0].result.to_json()["metrics"]["success"]
    p, z, n = success["value"], 1.959963984540054, 60
    half = z * (p * (1 - p) / n + z**2 / (4 * n**2)) ** 0.5 / (1 + z**2 / n)
    assert success["ci95"][1] - success["ci95"][0] >= 2 * half - 1e-12


def test_a_policy_that_does_not_fit_is_refused_before_bounds_are_solved(skilled, monkeypatch):
    statistics = {"mean": skilled.mean[1:], "std": skilled.std[1:]}
    narrow = replace(skilled, **statistics, layers=fewer(skilled), mirror=None)
    monkeypatch.setattr(Oracle, "solve_batch", None)
    with pytest.raises(PolicyFileError, match=r"maps 47 observations to 5 actions; arm 'paper'"):
        evaluate(narrow, trials=2, seed=77, oracle=True)


def fewer(policy):
    """Layers that take one observation less."""
    first, *others = policy.layers
    return (first._replace(weights=first.weights[:, 1:]), *others)
