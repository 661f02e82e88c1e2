"""Trials that success does not end, against an environment that is stepped and Pinocchio."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import kinarm  # noqa: F401 registers the environments
from kinarm.evaluation import pool
from kinarm.evaluation.contestants import AIM, ORACLE, Contestant, measure_holding
from kinarm.evaluation.evaluation import run_trials
from kinarm.evaluation.finding import find_contestants
from kinarm.evaluation.metrics import CLOSE, HOLDING_WITHIN
from kinarm.evaluation.outcomes import HOLDING_STEPS, Holding
from kinarm.evaluation.trials import TrialSet
from kinarm.policies import load_policy
from kinarm.problem import PROBLEMS


@pytest.fixture(scope="module")
def stepped(skilled, trials):
    """Closest approach, distance at the end and contact, by stepping an environment."""
    problem = trials.problem.replace(tolerance=1e-12)
    env = gymnasium.make("kinarm/ReachRight-v0", problem=problem).unwrapped
    found = []
    for start, goal in zip(trials.starts, trials.goals, strict=True):
        observation, _ = env.reset(options={"start": start, "goal": goal})
        distances, over = [], False
        while not over:
            observation, _, terminated, over, _ = env.step(skilled(observation))
            tool = env.simulator.arm.tool_position(env.episodes.q[0])  # through Pinocchio
            distances.append(np.linalg.norm(tool - goal))
            over |= terminated
        found.append((min(distances), max(distances[-HOLDING_STEPS:]), terminated, len(distances)))
    closest, at_end, touched, steps = map(np.array, zip(*found, strict=True))
    return closest, at_end, touched, steps


@pytest.fixture(scope="module")
def held(skilled, trials) -> Holding:
    return measure_holding(Contestant.from_policy("skilled", skilled), trials)


def test_every_trial_is_that_of_an_environment_that_nothing_satisfies(held, stepped):
    closest, at_end, touched, steps = stepped
    assert 0 < touched.sum() < len(touched)
    np.testing.assert_array_equal(held.collision, touched)
    np.testing.assert_array_equal(held.steps, steps)
    np.testing.assert_allclose(held.closest, closest, rtol=0, atol=1e-12)
    np.testing.assert_allclose(held.farthest_at_end[~touched], at_end[~touched], atol=1e-12)
    assert np.isinf(held.farthest_at_end[touched]).all()


def test_figures_are_shares_without_contact(skilled, trials, stepped):
    closest, at_end, touched, _ = stepped
    evaluation = run_trials(Contestant.from_policy("skilled", skilled), trials, hold=True)
    figures = evaluation.metrics
    for limit in CLOSE:
        expected = np.mean((closest <= limit) & ~touched)
        assert figures[f"closer_than_{1000 * limit:g}_mm"].value == expected
    assert figures["held"].value == np.mean((at_end <= HOLDING_WITHIN) & ~touched)
    assert figures["held_collision"].value == touched.mean()
    assert figures["median_approach"].value == pytest.approx(np.median(closest), abs=1e-12)
    assert figures["p95_approach"].value == pytest.approx(np.quantile(closest, 0.95), abs=1e-12)


def test_what_ends_at_success_stays_as_it_was(skilled, trials, skilled_evaluation):
    evaluation = run_trials(Contestant.from_policy("skilled", skilled), trials, hold=True)
    rows = [each.result.to_json() for each in (skilled_evaluation, evaluation)]
    for name, estimate in rows[0]["metrics"].items():
        if estimate["value"] is not None:
            assert rows[1]["metrics"][name] == estimate
    assert rows[1]["outcomes"] == rows[0]["outcomes"]
    assert set(rows[1]) - set(rows[0]) == {"held"}
    assert rows[1]["held"]["closest"] == evaluation.holding.closest.tolist()


def test_seeds_of_which_some_were_not_held_have_no_such_figures(skilled, trials):
    made = [replace(skilled.provenance, seed=seed) for seed in (0, 1)]
    seeds = [replace(skilled, provenance=each) for each in made]
    members = [
        run_trials(Contestant.from_policy(f"skilled-seed{n}", seed), trials, hold=n == 0)
        for n, seed in enumerate(seeds)
    ]
    (pooled,) = pool(members)
    assert pooled.metrics["held"].value is None
    assert pooled.metrics["success"].value == members[0].metrics["success"].value


def test_the_oracle_aims_closer_and_stays(trials):
    held = measure_holding(ORACLE, trials)
    assert (held.closest <= AIM + 1e-9).all()
    assert (held.farthest_at_end <= AIM + 1e-9).all()
    assert not held.collision.any()


def test_of_goals_that_follow_each_other_the_first_is_held():
    one, three = (
        TrialSet.draw(PROBLEMS["right"].replace(goal={"sequence": n}), 20, 0) for n in (1, 3)
    )
    np.testing.assert_array_equal(one.goals, three.goals)
    for name in ("oracle", "ars-tuned-both-seed0"):
        (contestant,) = find_contestants(name)
        expected, found = (measure_holding(contestant, trials) for trials in (one, three))
        np.testing.assert_array_equal(found.farthest_at_end, expected.farthest_at_end)


def test_a_function_that_remembers_has_the_figures_that_it_has_otherwise(trials):
    def drawing():
        rng = np.random.default_rng(0)
        return Contestant.from_function("draws", lambda seen: rng.uniform(-1, 1, (len(seen), 5)))

    held, plain = (run_trials(drawing(), trials, hold=hold) for hold in (True, False))
    np.testing.assert_array_equal(held.rollouts.distance, plain.rollouts.distance)


def test_what_is_exactly_there_goes_on_as_well(trials):
    """Inverse kinematics brings joints to within rounding of a goal, and often onto it."""
    contestant = Contestant.from_policy("best", load_policy("ppo-best-both-seed0"))
    held = measure_holding(contestant, trials)
    assert (held.steps == trials.problem.task.horizon)[~held.collision].all()
    assert np.isfinite(held.farthest_at_end[~held.collision]).all()
    assert (held.closest == 0.0).any()


def test_a_policy_that_does_not_move_stays_where_it_is(trials):
    held = measure_holding(find_contestants("zero")[0], trials)
    distance = trials.simulator.world.distances(trials.starts, trials.goals)
    np.testing.assert_allclose(held.closest, distance, atol=1e-12)
    np.testing.assert_allclose(held.farthest_at_end, distance, atol=1e-12)
    assert (held.steps == trials.problem.task.horizon).all()
