"""What is trained: against the paper's text and Table 1."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from kinarm.evaluation.paper.results import LITERAL
from kinarm.policies import recipe
from kinarm.problem import PROBLEMS
from kinarm.task import RewardWeights

EACH_TASK = dict.fromkeys(PROBLEMS, 4)


@pytest.fixture(scope="module")
def runs(results_of, made_up_run):
    return results_of(lambda _: made_up_run(np.ones(3))).runs


def literal(runs, purpose):
    return [r.planned.config for r in runs if r.purpose == purpose and r.reading == LITERAL]


def test_nine_settings_of_the_sweep(runs):
    sweep = literal(runs, "sweep")
    nine = {(rate, n) for rate in (0.05, 0.01, 0.005) for n in (16, 24, 32)}
    assert Counter((c.step_size, c.directions) for c in sweep) == dict.fromkeys(nine, 4)
    assert {(c.iterations, c.problem.name) for c in sweep} == {(300, "left")}
    assert all(2 * c.top_directions == c.directions for c in sweep)


def test_twelve_models_of_table_1(runs, experiment):
    models = literal(runs, "ars")
    assert Counter(c.problem.name for c in models) == EACH_TASK
    for config in models:
        assert (config.step_size, config.noise) == (0.02, 0.03)
        assert (config.directions, config.top_directions) == (24, 12)
        assert (config.problem.task.horizon, config.iterations) == (64, 800)
        assert config.recipe == recipe("ars", "paper").recipe
    assert experiment.trials.count == 200


def test_ppo_takes_the_papers_steps(runs):
    models = literal(runs, "ppo")
    assert Counter(c.problem.name for c in models) == EACH_TASK
    assert {c.iterations * c.steps_per_iteration for c in models} == {1_200_000}
    assert {c.recipe for c in models} == {recipe("ppo", "paper").recipe}


def test_every_reading_has_the_same_trainings(runs):
    assert len({run.name for run in runs}) == len(runs) == 36 + 144 + 48
    found = Counter((run.purpose, run.reading) for run in runs if run.purpose != "sweep")
    assert Counter(purpose for purpose, _ in found) == {"ars": 12, "ppo": 4}
    assert set(found.values()) == {12}


def test_trainings_follow_their_reading(runs):
    """Signs of all steps weigh as much as a metre of progress."""
    sign = RewardWeights(progress=0.0, closer=1 / 64)
    for run in runs:
        config, reading = run.planned.config, run.reading
        expected = PROBLEMS[run.task].task
        assert config.problem.task == replace(expected, start_spread=reading.start_spread)
        rewarded = expected.reward if reading.reward == "progress" else sign
        assert config.training_problem.task.reward == rewarded
