"""Drawn starts and goals: acceptable, uniform, and the same for the same seed."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from simulators import changed

from kinarm.arm import ArmSpecification
from kinarm.bodies import RandomBodies
from kinarm.errors import InvalidInputError, ProblemError
from kinarm.problem import PROBLEMS, ReachProblem
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


def test_starts_fill_the_limits(simulator):
    starts, _ = simulator.sample(np.random.default_rng(19), 4000)
    share = (starts - simulator.arm.lower) / (simulator.arm.upper - simulator.arm.lower)
    assert (share[:, :5].min(axis=0) < 0.05).all()
    assert (share[:, [0, 3, 4]].max(axis=0) > 0.98).all()
    np.testing.assert_array_equal(starts[:, 5], 0)


def test_a_negative_number_is_refused(simulator):
    with pytest.raises(InvalidInputError, match="count must be a whole number of at least 0"):
        simulator.sample(np.random.default_rng(0), -1)


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


def test_box_where_the_arm_starts_leaves_no_start(simulator):
    block = Obstacle(name="block", lower=(0.5, -0.1, 0.6), upper=(0.7, 0.1, 0.8))
    buried = changed(simulator, scene=Scene(obstacles=(block,)), start_spread=0)
    with pytest.raises(ProblemError, match="no contact-free start .* touches block"):
        buried.sample(np.random.default_rng(23), 3)


def test_random_body_where_the_arm_starts_is_named(simulator):
    there = {"lower": (0.6, 0.0, 0.7), "upper": (0.6, 0.0, 0.7)}
    ball = RandomBodies(name="ball", shape="sphere", smallest=(0.2,), largest=(0.2,), **there)
    buried = changed(simulator, scene=Scene(random_bodies=(ball,)), start_spread=0)
    with pytest.raises(ProblemError, match="no contact-free start .* touches ball 1"):
        buried.sample(np.random.default_rng(23), 3)


def test_goal_at_the_only_start_is_refused(simulator):
    there = changed(simulator, start_spread=0, tolerance=5)
    with pytest.raises(ProblemError, match="the tool already is at the goal"):
        there.sample(np.random.default_rng(24), 1)


def thick_problem(**task):
    """Goals in a box ahead of the arm and in a flat region to its left, nothing in the way."""
    ahead = GoalRegion(name="ahead", lower=(0.3, -0.2, 0.3), upper=(0.7, 0.2, 0.9))
    scene = Scene(obstacles=(), goal_regions=(ahead, *Scene().goal_regions))
    settings = {"goal_regions": ("ahead", "left"), **task}
    return ReachProblem(name="thick", scene=scene, task=ReachTask(**settings))


class TestGoalRegions:
    """Goals in the regions of a task."""

    def draw(self, problem, seed, count):
        return problem.task.goals_in(problem.scene).draw(np.random.default_rng(seed), count)

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
        expected = np.where(uniforms[:, :1] < 0.5, left, left - (0, 1.3, 0))
        both = self.draw(ReachProblem.load("both"), 4, 500)
        np.testing.assert_allclose(both, expected, rtol=0, atol=1e-15)

    @given(st.lists(st.floats(0.01, 100), min_size=1, max_size=4), st.integers(0, 2**32 - 1))
    def test_goals_lie_in_the_regions_that_the_task_names(self, weights, seed):
        regions = tuple(
            GoalRegion(name=f"{k}", lower=(k, -1.0, 0.5 * k), upper=(k + 0.5, 1.0, 0.5 * k + k % 2))
            for k in range(5)
        )
        named = tuple(region.name for region in regions[: len(weights)])
        task = ReachTask(goal_regions=named, goal_weights=tuple(weights))
        goals = task.goals_in(Scene(goal_regions=regions)).draw(np.random.default_rng(seed), 40)
        inside = [
            ((goals >= region.lower) & (goals <= region.upper)).all(axis=1)
            for region in regions[: len(weights)]
        ]
        assert (np.sum(inside, axis=0) == 1).all()


LISTED = ((0.0,) * 6, (0.5, 0.1, 0.0, 0.0, 0.0, 0.0), (-0.5, 0.0, 0.2, 0.0, 0.0, 0.0))
RIGHT = PROBLEMS["right"]


def test_each_listed_start_is_drawn_as_often_as_the_others():
    starts, _ = Simulator(RIGHT.replace(starts=LISTED)).sample(np.random.default_rng(3), 6000)
    counts = [int((starts == listed).all(axis=1).sum()) for listed in LISTED]
    assert sum(counts) == 6000
    assert stats.chisquare(counts).pvalue > 1e-4


def test_listed_starts_near_the_goal_are_not_drawn_for_it():
    """The second one reaches every goal of a region as large as the tolerance."""
    simulator = Simulator(RIGHT.replace(starts=LISTED, tolerance=0.5))
    starts, goals = simulator.sample(np.random.default_rng(4), 500)
    tools = np.array([simulator.arm.tool_position(start) for start in starts])
    assert (np.linalg.norm(tools - goals, axis=1) > 0.5).all()
    assert {tuple(start) for start in starts} <= {*LISTED}


@pytest.mark.parametrize(
    ("start", "words"),
    [
        ((0.0,) * 5, r"task.starts\[1\] must have shape \(6\), got \(5,\)"),
        ((9.0, *[0.0] * 5), r"task.starts\[1\] lies outside the limits: axis_1 at 9"),
    ],
)
def test_listed_starts_that_no_arm_can_take_are_refused(start, words):
    with pytest.raises((InvalidInputError, ProblemError), match=words):
        Simulator(RIGHT.replace(starts=(LISTED[0], start)))


def test_listed_starts_in_contact_are_refused():
    arm = Simulator(RIGHT).arm
    x, y, z = arm.tool_position(LISTED[0])
    crate = Obstacle(
        name="crate", lower=(x - 0.05, y - 0.05, z - 0.05), upper=(x + 0.05, y + 0.05, z + 0.05)
    )
    scene = Scene(obstacles=(crate,), goal_regions=RIGHT.scene.goal_regions)
    with pytest.raises(ProblemError, match=r"task.starts\[0\] is in contact: .* touches crate"):
        Simulator(RIGHT.replace(starts=LISTED[:1], scene=scene))
