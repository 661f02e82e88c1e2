"""Obstacles, goal regions and scenes."""

import math

import numpy as np
import pytest

from kinarm.errors import ProblemError, UnknownNameError
from kinarm.scene import GoalRegion, Obstacle, Scene


def obstacle(**changes):
    return Obstacle(**{"name": "table", "lower": (0, -1, 0), "upper": (1, 0.5, 0.4), **changes})


def region(**changes):
    return GoalRegion(**{"name": "top", "lower": (0, -1, 0.4), "upper": (1, 0.5, 0.4), **changes})


class TestPapersScene:
    def test_ground_and_two_benches(self):
        scene = Scene()
        assert scene.ground
        assert scene.cube_edge == 0.05
        right, left = scene.obstacles
        assert (right.name, left.name) == ("right bench", "left bench")
        assert (right.lower, right.upper) == ((-0.5, -0.75, 0), (0.5, -0.55, 0.3))
        assert (left.lower, left.upper) == ((-0.5, 0.55, 0), (0.5, 0.75, 0.3))

    def test_goals_are_centres_of_cubes_on_the_benches(self):
        scene = Scene()
        for bench in scene.obstacles:
            goals = scene.goal_region(bench.name.removesuffix(" bench"))
            height = bench.upper[2] + scene.cube_edge / 2
            assert goals.lower == (*bench.lower[:2], pytest.approx(height))
            assert goals.upper == (*bench.upper[:2], pytest.approx(height))

    def test_sides_are_mirror_images(self):
        for right, left in (Scene().obstacles, Scene().goal_regions):
            assert (right.name[:5], left.name[:4]) == ("right", "left")
            assert (left.lower[0], left.lower[2]) == (right.lower[0], right.lower[2])
            assert (left.lower[1], left.upper[1]) == (-right.upper[1], -right.lower[1])


def test_size_and_centre():
    np.testing.assert_allclose(obstacle().size, [1, 1.5, 0.4])
    np.testing.assert_allclose(obstacle().centre, [0.5, -0.25, 0.2])


def test_unknown_goal_region_lists_those_that_are():
    with pytest.raises(UnknownNameError, match="goal region 'middle'; available: right, left"):
        Scene().goal_region("middle")


@pytest.mark.parametrize(
    "upper", [(0, 0.5, 0.4), (1, -1, 0.4), (1, 0.5, 0), (-1, 0.5, 0.4), (1, -2, 0.4)]
)
def test_empty_obstacle_is_refused(upper):
    with pytest.raises(ProblemError, match="obstacle 'table' is empty.*expected lower < upper"):
        obstacle(upper=upper)


@pytest.mark.parametrize("upper", [(1, -1, 0.4), (0, -1, 0.4), (0, -1, 0.9), (1, -2, 0.4)])
def test_goal_region_without_area_is_refused(upper):
    with pytest.raises(ProblemError, match="goal region 'top' is empty.*along two axes at least"):
        region(upper=upper)


@pytest.mark.parametrize("make", [obstacle, region])
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("corner", ["lower", "upper"])
def test_corners_must_be_finite(make, bad, corner):
    with pytest.raises(ProblemError, match="corners of .* '(table|top)' must be finite"):
        make(**{corner: (0.5, bad, 0.4)})


def test_names_must_differ():
    with pytest.raises(ProblemError, match="two obstacles are called 'table'"):
        Scene(obstacles=(obstacle(), obstacle(upper=(2, 2, 2))))
    with pytest.raises(ProblemError, match="two goal regions are called 'top'"):
        Scene(goal_regions=(region(), region()))


def test_an_obstacle_and_the_goals_on_it_may_share_a_name():
    scene = Scene(obstacles=(obstacle(),), goal_regions=(region(name="table"),))
    assert scene.goal_region("table").name == "table"


@pytest.mark.parametrize("edge", [-0.01, math.nan, math.inf])
def test_cube_edge_must_be_a_length(edge):
    with pytest.raises(ProblemError, match="cube_edge"):
        Scene(cube_edge=edge)


def test_what_is_too_far_away_is_refused():
    with pytest.raises(ProblemError, match=r"'far' must be at most 1e\+06, got"):
        Obstacle(name="far", lower=(0.0, 0.0, 0.0), upper=(1.0, 1.0, 2e6))
