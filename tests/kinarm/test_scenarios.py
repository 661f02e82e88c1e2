"""Drawn starts and goals: acceptable, uniform, and the same for the same seed."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from simulators import changed

from kinarm.arm import ArmSpecification
from kinarm.errors import ProblemError
from kinarm.problem import ReachProblem
from kinarm.scenarios import PREFETCHED, ScenarioStream, draw_scenarios
from kinarm.scene import GoalRegion, Obstacle, Scene
from kinarm.simulator import Simulator
from kinarm.task import ReachTask


def test_starts_are_free_and_away_from_the_goal(any_simulator):
    starts, goals = any_simulator.sample(np.random.default_rng(15), 1500)
    assert not any_simulator.world.contact_model.in_contact(starts).any()
    tools = np.array([any_simulator.arm.tool_position(q) for q in starts[:300]])
    distances = np.linalg.norm(tools - goals[:300], axis=1)
    assert (distances > any_simulator.task.tolerance).all()
    assert ((starts >= any_simulator.arm.lower) & (starts <= any_simulator.arm.upper)).all()


def test_starts_near_the_goal_are_rejected(simulator):
    wide = changed(simulator, tolerance=0.8)
    starts, goals = wide.sample(np.random.default_rng(16), 200)
    tools = np.array([wide.arm.tool_position(q) for q in starts])
    assert (np.linalg.norm(tools - goals, axis=1) > 0.8).all()


def test_same_seed_same_scenarios(simulator):
    first, second, other = (simulator.sample(np.random.default_rng(seed), 20) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first[0], second[0])
    np.testing.assert_array_equal(first[1], second[1])
    assert (first[0][:, 0] != other[0][:, 0]).all()


def test_goals_lie_on_the_benches_half_on_each(simulator):
    _, goals = simulator.sample(np.random.default_rng(17), 8000)
    assert (goals[:, 2] == 0.325).all()
    assert (np.abs(goals[:, 0]) <= 0.5).all()
    assert ((np.abs(goals[:, 1]) >= 0.55) & (np.abs(goals[:, 1]) <= 0.75)).all()
    # Six standard deviations of a fair coin.
    assert abs((goals[:, 1] > 0).mean() - 0.5) < 6 * 0.5 / math.sqrt(8000)


@pytest.mark.parametrize(("name", "side"), [("left", 1), ("right", -1)])
def test_goals_are_uniform_over_a_bench(name, side):
    _, goals = Simulator(name, threads=1).sample(np.random.default_rng(18), 4000)
    across = side * goals[:, 1]
    assert stats.kstest(goals[:, 0], stats.uniform(-0.5, 1).cdf).pvalue > 1e-4
    assert stats.kstest(across, stats.uniform(0.55, 0.2).cdf).pvalue > 1e-4


def test_starts_fill_the_limits(simulator):
    starts, _ = simulator.sample(np.random.default_rng(19), 4000)
    share = (starts - simulator.arm.lower) / (simulator.arm.upper - simulator.arm.lower)
    assert (share[:, :5].min(axis=0) < 0.05).all()
    assert (share[:, [0, 3, 4]].max(axis=0) > 0.98).all()
    np.testing.assert_array_equal(starts[:, 5], 0)


def test_start_spread_scales_the_range_about_home(simulator):
    home = (0.3, 0.1, 0.2, -0.4, 0.5, 0.0)
    near = changed(simulator, arm=ArmSpecification(home=home), start_spread=0.1)
    home = np.array(home)
    starts, _ = near.sample(np.random.default_rng(20), 3000)
    low = home + 0.1 * (near.arm.lower - home)
    high = home + 0.1 * (near.arm.upper - home)
    moved = slice(0, 5)
    assert (starts[:, moved] >= low[moved]).all()
    assert (starts[:, moved] <= high[moved]).all()
    np.testing.assert_allclose(starts[:, moved].min(axis=0), low[moved], atol=0.01)
    np.testing.assert_allclose(starts[:, moved].max(axis=0), high[moved], atol=0.01)


def test_no_spread_starts_at_home(simulator):
    starts, goals = changed(simulator, start_spread=0).sample(np.random.default_rng(21), 50)
    np.testing.assert_array_equal(starts, np.zeros((50, 6)))
    assert len(np.unique(goals, axis=0)) == 50


def test_nothing_to_draw(simulator):
    starts, goals = simulator.sample(np.random.default_rng(22), 0)
    assert starts.shape == (0, 6)
    assert goals.shape == (0, 3)


def test_given_spread_comes_before_that_of_the_task(simulator):
    starts, _ = simulator.sample(np.random.default_rng(21), 50, start_spread=0)
    np.testing.assert_array_equal(starts, np.zeros((50, 6)))
    drawn = draw_scenarios(simulator.world, np.random.default_rng(3), 20, start_spread=0.3)
    near = changed(simulator, start_spread=0.3).sample(np.random.default_rng(3), 20)
    np.testing.assert_array_equal(drawn[0], near[0])
    np.testing.assert_array_equal(drawn[1], near[1])


def test_box_where_the_arm_starts_leaves_no_start(simulator):
    block = Obstacle(name="block", lower=(0.5, -0.1, 0.6), upper=(0.7, 0.1, 0.8))
    buried = changed(simulator, scene=Scene(obstacles=(block,)), start_spread=0)
    with pytest.raises(ProblemError, match="no contact-free start .* touches block"):
        buried.sample(np.random.default_rng(23), 3)


def test_goal_at_the_only_start_is_refused(simulator):
    there = changed(simulator, start_spread=0, tolerance=5)
    with pytest.raises(ProblemError, match="the tool already is at the goal"):
        there.sample(np.random.default_rng(24), 1)


class TestStream:
    def test_goes_on_where_it_stopped(self, simulator):
        rng = np.random.default_rng(4)
        batches = [draw_scenarios(simulator.world, rng, PREFETCHED) for _ in range(2)]
        stream = ScenarioStream(simulator.world, np.random.default_rng(4))
        for starts, goals in batches:
            for start, goal in zip(starts, goals, strict=True):
                found = stream.next()
                np.testing.assert_array_equal(found[0], start)
                np.testing.assert_array_equal(found[1], goal)


def thick_problem(**task):
    """Goals in a box ahead of the arm and in a flat region to its left, nothing in the way."""
    ahead = GoalRegion(name="ahead", lower=(0.3, -0.2, 0.3), upper=(0.7, 0.2, 0.9))
    scene = Scene(obstacles=(), goal_regions=(ahead, *Scene().goal_regions))
    settings = {"goal_regions": ("ahead", "left"), **task}
    return ReachProblem(name="thick", scene=scene, task=ReachTask(**settings))


class TestGoalRegions:
    """Goals of `ReachTask.draw_goals`."""

    def draw(self, problem, seed, count):
        return problem.task.draw_goals(problem.scene, np.random.default_rng(seed), count)

    @pytest.mark.parametrize("weights", [(), (3.0, 1.0), (1, 1), (0.1, 0.9)])
    def test_are_chosen_by_their_weights(self, weights):
        goals = self.draw(thick_problem(goal_weights=weights), 1, 20_000)
        share = (weights or (1, 1))[0] / sum(weights or (1, 1))
        found = (goals[:, 1] < 0.5).mean()
        assert abs(found - share) < 6 * math.sqrt(share * (1 - share) / 20_000)

    def test_goals_are_uniform_over_a_thick_and_over_a_flat_one(self):
        goals = self.draw(thick_problem(), 2, 8000)
        thick, flat = goals[goals[:, 1] < 0.5], goals[goals[:, 1] > 0.5]
        for axis, (low, high) in enumerate(((0.3, 0.7), (-0.2, 0.2), (0.3, 0.9))):
            assert stats.kstest(thick[:, axis], stats.uniform(low, high - low).cdf).pvalue > 1e-4
        assert stats.kstest(flat[:, 0], stats.uniform(-0.5, 1).cdf).pvalue > 1e-4
        assert stats.kstest(flat[:, 1], stats.uniform(0.55, 0.2).cdf).pvalue > 1e-4
        assert (flat[:, 2] == 0.325).all()
        correlations = np.corrcoef(thick.T) - np.eye(3)
        assert np.abs(correlations).max() < 0.1

    def test_first_number_chooses_the_region_and_one_follows_for_each_axis_with_an_extent(self):
        uniforms = np.random.default_rng(3).random((500, 4))
        expected = np.where(
            uniforms[:, :1] < 0.75,
            (0.3, -0.2, 0.3) + uniforms[:, 1:] * (0.4, 0.4, 0.6),
            (-0.5, 0.55, 0.325) + uniforms[:, 1:] * (1, 0.2, 0),
        )
        goals = self.draw(thick_problem(goal_weights=(3, 1)), 3, 500)
        np.testing.assert_allclose(goals, expected, rtol=0, atol=1e-15)

    def test_flat_regions_of_one_height_take_three_numbers_a_goal(self):
        uniforms = np.random.default_rng(4).random((500, 3))
        left = (-0.5, 0.55, 0.325) + np.c_[uniforms[:, 1:] * (1, 0.2), np.zeros(500)]
        goals = self.draw(ReachProblem.load("left"), 4, 500)
        np.testing.assert_allclose(goals, left, rtol=0, atol=1e-15)
        both = self.draw(ReachProblem.load("both"), 4, 500)
        right = left - (0, 1.3, 0)
        expected = np.where(uniforms[:, :1] < 0.5, left, right)
        np.testing.assert_allclose(both, expected, rtol=0, atol=1e-15)

    def test_starts_keep_away_from_goals_in_a_thick_region(self):
        problem = thick_problem(tolerance=0.2)
        simulator = Simulator(problem, threads=1)
        starts, goals = simulator.sample(np.random.default_rng(5), 300)
        assert (simulator.world.distances(starts, goals) > 0.2).all()
        assert ((goals[:, 1] < 0.5) & (goals[:, 2] > 0.4)).any()

    @given(st.lists(st.floats(0.01, 100), min_size=1, max_size=4), st.integers(0, 2**32 - 1))
    def test_goals_lie_in_the_regions_that_the_task_names(self, weights, seed):
        regions = tuple(
            GoalRegion(name=f"{k}", lower=(k, -1.0, 0.5 * k), upper=(k + 0.5, 1.0, 0.5 * k + k % 2))
            for k in range(5)
        )
        named = tuple(region.name for region in regions[: len(weights)])
        task = ReachTask(goal_regions=named, goal_weights=tuple(weights))
        goals = task.draw_goals(Scene(goal_regions=regions), np.random.default_rng(seed), 40)
        inside = [
            ((goals >= region.lower) & (goals <= region.upper)).all(axis=1)
            for region in regions[: len(weights)]
        ]
        assert (np.sum(inside, axis=0) == 1).all()
