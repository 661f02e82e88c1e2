"""Tasks and rewards."""

import dataclasses

import numpy as np
import pytest

from kinarm.errors import InvalidInputError, ProblemError, UnknownNameError
from kinarm.scene import Scene
from kinarm.task import TASKS, ReachTask, RewardWeights, load_task, reward_terms


def reach(**settings):
    return ReachTask(**{"name": "test", "benches": ("left",), **settings})


def test_three_tasks_with_the_papers_settings():
    assert list(TASKS) == ["left", "right", "both"]
    for name, task in TASKS.items():
        assert task.name == name
        assert (task.tolerance, task.horizon, task.start_spread) == (0.05, 64, 1.0)
        assert task.reward == RewardWeights(progress=1, closer=0, collision=-1, success=0, step=0)
    assert TASKS["left"].benches == ("left",)
    assert TASKS["right"].benches == ("right",)
    assert set(TASKS["both"].benches) == {"left", "right"}


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"benches": ()}, "names no bench"),
        ({"tolerance": 0}, "tolerance must be greater than 0 m, got 0"),
        ({"tolerance": -0.1}, "tolerance"),
        ({"tolerance": float("nan")}, "tolerance"),
        ({"tolerance": float("inf")}, "tolerance"),
        ({"start_spread": -0.1}, r"start_spread must lie in \[0, 1\], got -0.1"),
        ({"start_spread": 1.5}, "start_spread"),
        ({"start_spread": float("nan")}, "start_spread"),
    ],
)
def test_impossible_settings_are_refused(settings, message):
    with pytest.raises(ProblemError, match=message):
        reach(**settings)


@pytest.mark.parametrize("term", ["progress", "collision", "success", "step"])
@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_reward_weights_must_be_finite(term, value):
    with pytest.raises(ProblemError, match=f"reward weight {term} must be finite"):
        RewardWeights(**{term: value})


@pytest.mark.parametrize("value", [RewardWeights(), TASKS["left"]])
def test_frozen(value):
    with pytest.raises(dataclasses.FrozenInstanceError):
        value.step = 1


class TestReward:
    def test_terms_by_hand(self):
        weights = RewardWeights(progress=2, closer=0.1, collision=-3, success=5, step=-0.5)
        terms = reward_terms(
            weights,
            np.array([1.0, 1.0, 0.5]),
            np.array([0.75, 1.0, 0.04]),
            np.array([False, True, False]),
            np.array([False, False, True]),
        )
        np.testing.assert_allclose(terms.progress, [0.5, 0, 0.92])
        np.testing.assert_array_equal(terms.closer, [0.1, 0, 0.1])
        np.testing.assert_array_equal(terms.collision, [0, -3, 0])
        np.testing.assert_array_equal(terms.success, [0, 0, 5])
        np.testing.assert_array_equal(terms.step, [-0.5, -0.5, -0.5])
        np.testing.assert_allclose(terms.total, [0.1, -3.5, 5.52])

    def test_closer_is_positive_and_farther_negative(self):
        no = np.array([False, False])
        terms = reward_terms(RewardWeights(), np.array([1.0, 1.0]), np.array([0.9, 1.1]), no, no)
        np.testing.assert_allclose(terms.total, [0.1, -0.1])

    def test_steps_closer_count_the_same_however_far(self):
        no, before = np.full(4, False), np.ones(4)
        signs = RewardWeights(progress=0, closer=0.5)
        terms = reward_terms(signs, before, np.array([0.9, 0.999, 1.0, 1.2]), no, no)
        np.testing.assert_array_equal(terms.total, [0.5, 0.5, 0, -0.5])


class TestGoals:
    def test_corners(self):
        uniforms = np.array([[0, 0, 0], [0.4999, 0.5, 1], [0.5, 1, 0], [0.9999, 0, 0]])
        goals = TASKS["both"].goals(Scene(), uniforms)
        expected = [
            [-0.5, 0.55, 0.325],
            [0, 0.75, 0.325],
            [0.5, -0.75, 0.325],
            [-0.5, -0.75, 0.325],
        ]
        np.testing.assert_allclose(goals, expected)

    def test_single_bench_ignores_the_first_number(self):
        uniforms = np.array([[0.0, 0.3, 0.6], [0.99, 0.3, 0.6]])
        first, second = TASKS["right"].goals(Scene(), uniforms)
        np.testing.assert_array_equal(first, second)


class TestLoadTask:
    def test_by_name(self):
        assert load_task("right") is not None
        assert load_task("right") == TASKS["right"]

    def test_overrides(self):
        task = load_task("both", horizon=10, tolerance=None, start_spread=0.5)
        assert (task.horizon, task.tolerance, task.start_spread) == (10, 0.05, 0.5)
        assert TASKS["both"].horizon == 64

    def test_task_object_passes_through_and_can_be_changed(self):
        task = reach(horizon=5)
        assert load_task(task) == task
        assert load_task(task, horizon=6).horizon == 6

    def test_unknown_task_lists_the_tasks(self):
        with pytest.raises(UnknownNameError, match="task 'up'; available: left, right, both"):
            load_task("up")

    def test_unknown_setting_lists_the_settings(self):
        with pytest.raises(UnknownNameError, match="setting 'horizons'.*horizon.*start_spread"):
            load_task("left", horizons=3)

    def test_bad_override_is_refused(self):
        with pytest.raises(ProblemError, match="tolerance"):
            load_task("left", tolerance=0)


@pytest.mark.parametrize("horizon", [0, -5, 2.5, float("nan")])
def test_impossible_horizon_is_refused(horizon):
    with pytest.raises(InvalidInputError, match="horizon must be a whole number of at least 1"):
        load_task("left", horizon=horizon)
