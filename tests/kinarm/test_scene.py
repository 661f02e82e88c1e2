"""Obstacles, goal regions and scenes."""

import math

import numpy as np
import pytest

from kinarm.errors import InvalidInputError, ProblemError
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


def test_size_and_centre():
    np.testing.assert_allclose(obstacle().body.size, [1, 1.5, 0.4])
    np.testing.assert_allclose(obstacle().body.position, [0.5, -0.25, 0.2])


@pytest.mark.parametrize(
    ("make", "changes", "message"),
    [
        (obstacle, {"upper": (1, -1, 0.4)}, "obstacle 'table' is empty.*expected lower < upper"),
        (obstacle, {"lower": (0.5, math.nan, 0.4)}, "lower must be finite, got nan"),
        (obstacle, {"upper": (1.0, 1.0, 2e6)}, r"upper must be at most 1e\+06, got 2"),
        (region, {"upper": (0, -1, 0.9)}, "goal region 'top' is empty.*along two axes at least"),
        (Scene, {"obstacles": 2 * (obstacle(),)}, "two obstacles are called 'table'"),
        (Scene, {"obstacles": (obstacle(name="ground"),)}, "two obstacles are called 'ground'"),
        (Scene, {"obstacles": 1001 * (obstacle(),)}, "1001 obstacles: at most 1000"),
        (Scene, {"cube_edge": -0.01}, "cube_edge"),
    ],
)
def test_impossible_ones_are_refused(make, changes, message):
    with pytest.raises((InvalidInputError, ProblemError), match=message):
        make(**changes)
